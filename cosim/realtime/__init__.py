"""Runs that go by the clock: absolute deadlines, overruns, and how late every sample was."""
