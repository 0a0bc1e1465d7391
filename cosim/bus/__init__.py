"""The sensor as a device under test on a CAN bus: the frames, both ends, and what is measured.

`messages` says what is in which frame, `suspension.dbc` is made of it. `sensor` is the bench's end,
a block of the loop; `node` is the sensor's end, a process of its own.
"""
