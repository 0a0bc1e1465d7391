"""Finds the defects of a co-simulation FMU, FMI 2.0 or 3.0: in its files, and while it runs.

`cosim.check.checker.check` is the way in. Nothing is imported here: the child processes in which
FMUs run start quickly.
"""
