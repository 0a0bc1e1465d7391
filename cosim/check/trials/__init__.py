"""Trials of an FMU in a process of its own: `python -m cosim.check.trials JOB`.

Nothing here imports more than the standard library, so that fifteen processes start in a second.
"""
