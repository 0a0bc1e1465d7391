"""The trained networks and filters that are shipped, each beside its model card."""

from pathlib import Path

from sensor.errors import SensorError

_HERE = Path(__file__).parent


def default_model() -> Path:
    """Return the path of the shipped network; raises SensorError if this installation has none."""
    return _shipped("bilstm_w19.onnx")


def default_fir() -> Path:
    """Return the path of the shipped linear filter; raises SensorError if this installation has
    none.
    """
    return _shipped("fir_w19.npz")


def _shipped(name: str) -> Path:
    path = _HERE / name
    if not path.is_file():
        raise SensorError(
            f"{path}: no such model is shipped here; train one (sensor.train) or name a file."
        )
    return path
