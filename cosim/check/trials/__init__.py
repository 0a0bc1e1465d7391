"""Trials of an FMU, each in a process of its own (`cosim.isolation`).

Nothing here imports more than the standard library, so that fifteen processes start in a second.
"""
