"""What commands the dampers: the block of the loop, and a law in each file beside it."""
