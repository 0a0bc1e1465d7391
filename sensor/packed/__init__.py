"""A trained network without ONNX: read from its file, checked for its structure, written as the
bytes that the C sensor (`fmu/sensor`) reads.
"""

from sensor.packed.layout import blob
from sensor.packed.network import PackedNetwork
from sensor.packed.reader import read_network

__all__ = ["PackedNetwork", "blob", "read_network"]
