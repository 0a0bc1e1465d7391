"""`cosim pack`: a trained network as an FMU that needs nothing but its importer."""
