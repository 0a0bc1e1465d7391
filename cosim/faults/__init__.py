"""Faults of the channels between measurement and sensor, and latencies of the loop.

`stack` is the block of the loop; `values` and `messages` are the faults; `assemble` makes them from
a scenario. Nothing here is random but by the seeds of the scenario.
"""
