"""The bytes of a packed network, as `fmu/sensor/packed.h` describes them.

A header of 64 bytes, then sections, each filled up to a multiple of 64 bytes. Matrices lie as the
kernels read them: blocks of 64 sums; within a block, for each input 64 weights. An LSTM's block
holds the gates of 16 units as [i f g o] of the first 8 and [i f g o] of the last 8; units are
filled up to a multiple of 16 with zeros. Everything is little-endian.
"""

import struct
import zlib
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from sensor.errors import SensorError
from sensor.packed.network import PackedNetwork

Array = npt.NDArray[Any]

MAGIC: Final = b"VRELNET\0"
BYTE_ORDER: Final = 0x01020304
VERSION: Final = 1
ALIGNMENT: Final = 64
BLOCK: Final = 64
UNITS: Final = 16
MOST: Final = 4096  # units or samples: MOST_UNITS, MOST_SAMPLES of fmu/sensor/packed.c
HALF: Final = 8
_FLOATS: Final = (
    *("residual_least", "residual_most", "slip_least", "slip_most", "least_speed", "least_energy"),
    *("sample_time", "wheelbase_samples", "age_least", "age_most", "speed_unit", "slowness_unit"),
    *("moving_least", "moving_most", "scale", "deviation_least", "deviation_most"),
)
_RESIDUALS: Final = (
    *("wheels", "driving", "steering", "slip"),
    *("spread", "others", "rolling", "lowest", "highest"),
)
_GATES: Final = [0, 2, 3, 1]  # ONNX's input, output, forget, cell -> input, forget, cell, output


def blob(network: PackedNetwork) -> bytes:
    """Return the packed network. Raises SensorError naming what is too large for the C sensor."""
    _check_shape(network)
    sections = _windowed(network) if network.kind == "windowed" else _carried(network)
    content = b"".join(_filled(section) for section in sections)
    carried = network.kind == "carried"
    depth = int(network.arrays["depth"]) if carried else 0
    rest = struct.pack(
        "<10I",
        *(carried, 0 if carried else network.window, network.units, network.hidden),
        *(network.residual, network.front, network.leads, depth, _warm_up(network), 0),
    )
    size, checksum = ALIGNMENT + len(content), zlib.crc32(content, zlib.crc32(rest))
    return struct.pack("<8s4I", MAGIC, BYTE_ORDER, VERSION, size, checksum) + rest + content


def _check_shape(network: PackedNetwork) -> None:
    shape = {"samples in a window": network.window, "units": network.units}
    shape |= {"hidden units": network.hidden, "units before the LSTM": network.front}
    shape |= {"moments of the delay line": network.leads}
    shape |= {"samples of the delay line": int(network.arrays.get("depth", 0))}
    beyond = [f"{value} {name}" for name, value in shape.items() if value > MOST]
    if beyond:
        raise SensorError(f"it has {', '.join(beyond)}, where at most {MOST} are supported.")


def _warm_up(network: PackedNetwork) -> int:
    from sensor.carried.runtime import WARM_UP

    return WARM_UP if network.kind == "carried" else network.window - 1


def _windowed(network: PackedNetwork) -> Iterator[bytes]:
    a, units = network.arrays, network.units
    if network.residual:
        yield b"".join(_doubles(a[name]) for name in _RESIDUALS)
    for name in ("input_mean", "input_std", "output_mean", "output_std"):
        yield _floats(a[name])
    yield from _layer(_gates(a["forward_W"]), _gates(a["forward_B"]))
    yield from _layer(*(_gates(_four_gates(a[f"backward_{part}"])) for part in ("W", "B")))
    yield from _layer(_gates(a["forward_R"]))
    dense = a["dense_W"].reshape(-1, 2, units)
    padded = -units % UNITS
    yield from _layer(
        np.pad(dense, ((0, 0), (0, 0), (0, padded))).reshape(len(dense), -1), a["dense_B"]
    )
    yield from _readout(a["output_W"], a["output_B"])


def _carried(network: PackedNetwork) -> Iterator[bytes]:
    a = network.arrays
    yield _features(a)
    for name in ("leads", "moving_scales", "mean", "std"):
        yield _floats(a[name])
    yield from _layer(a["front_W"], a["front_B"])
    both = np.concatenate([a["lstm_W"][0], a["lstm_R"][0]], axis=1)
    bias = a["lstm_B"].reshape(2, -1).sum(axis=0, dtype=np.float32)
    yield from _layer(_gates(both), _gates(bias))
    yield from _layer(a["hidden_W"], a["hidden_B"])
    yield from _readout(a["output_W"], a["output_B"])
    yield from _readout(a["deviation_W"], a["deviation_B"])
    yield from _readout(a["straight_W"])


def _features(a: Mapping[str, Array]) -> bytes:
    from sensor.carried.runtime import LARGEST

    doubles = (LARGEST, a["wheel_y"], a["axle"], a["per_ay"], a["per_ax"])
    floats = (
        "slowest_rates",
        "zeros_before",
        "typical",
        "integral_keep",
        "deviation_scale",
        *_FLOATS,
    )
    return b"".join([*map(_doubles, doubles), *(_floats(a[name]) for name in floats)])


def _four_gates(rows: Array) -> Array:
    """Return input, cell and output gate as an LSTM's four, in ONNX's order; zeros forget."""
    gates = rows.reshape(3, -1, *rows.shape[1:])
    return np.stack([gates[0], gates[2], np.zeros_like(gates[0]), gates[1]]).reshape(
        -1, *rows.shape[1:]
    )


def _gates(rows: Array) -> Array:
    """Return an LSTM's rows (4 units, ...) in the order of its blocks, filled up with zeros."""
    gates = rows.reshape(4, -1, *rows.shape[1:])[_GATES]
    more = -gates.shape[1] % UNITS
    gates = np.pad(gates, [(0, 0), (0, more), *[(0, 0)] * (gates.ndim - 2)])
    halves = gates.reshape(4, -1, HALF, *rows.shape[1:]).swapaxes(0, 1)
    return halves.reshape(-1, *rows.shape[1:])


def _layer(weight: Array, bias: Array | None = None) -> Iterator[bytes]:
    """Yield the section of a matrix (sums, inputs), and that of its bias if it has one."""
    more = -len(weight) % BLOCK
    blocks = np.pad(weight, ((0, more), (0, 0))).reshape(-1, BLOCK, weight.shape[1])
    yield _floats(blocks.swapaxes(1, 2))
    if bias is not None:
        yield _floats(np.pad(bias, (0, more)))


def _readout(weight: Array, bias: Array | None = None) -> Iterator[bytes]:
    yield _floats(np.pad(weight, ((0, 0), (0, -weight.shape[1] % UNITS))))
    if bias is not None:
        yield _floats(bias)


def _floats(array: Array) -> bytes:
    return np.ascontiguousarray(array, dtype="<f4").tobytes()


def _doubles(array: Array) -> bytes:
    return np.ascontiguousarray(array, dtype="<f8").tobytes()


def _filled(section: bytes) -> bytes:
    return section + bytes(-len(section) % ALIGNMENT)
