"""A windowed network with one step per sample: the windows in flight advance together."""
