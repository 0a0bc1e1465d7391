"""`cosim compare`: runs that are there already, side by side as a table and as one page."""
