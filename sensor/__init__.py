"""A virtual sensor for suspension velocities: 14 production-car channels in, four velocities out.

Names are loaded when first used, so importing the package costs nothing; only training and export
need torch and onnx.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sensor.baselines import FirFilter, StillWheels, Zero
    from sensor.body_motion import BodyMotion, Geometry
    from sensor.channels import (
        CHANNEL_NAMES,
        CHANNELS,
        OUTPUT_NAMES,
        OUTPUTS,
        SAMPLE_RATE_HZ,
        Channel,
    )
    from sensor.errors import SensorError
    from sensor.estimator import Estimator
    from sensor.metrics import Figures, Metrics, evaluate
    from sensor.runtime import OnnxSensor

_HOME = {
    "CHANNELS": "channels",
    "CHANNEL_NAMES": "channels",
    "OUTPUTS": "channels",
    "OUTPUT_NAMES": "channels",
    "SAMPLE_RATE_HZ": "channels",
    "BodyMotion": "body_motion",
    "Channel": "channels",
    "Estimator": "estimator",
    "Figures": "metrics",
    "FirFilter": "baselines",
    "Geometry": "body_motion",
    "Metrics": "metrics",
    "OnnxSensor": "runtime",
    "SensorError": "errors",
    "StillWheels": "baselines",
    "Zero": "baselines",
    "evaluate": "metrics",
}

__all__ = [
    "CHANNELS",
    "CHANNEL_NAMES",
    "OUTPUTS",
    "OUTPUT_NAMES",
    "SAMPLE_RATE_HZ",
    "BodyMotion",
    "Channel",
    "Estimator",
    "Figures",
    "FirFilter",
    "Geometry",
    "Metrics",
    "OnnxSensor",
    "SensorError",
    "StillWheels",
    "Zero",
    "evaluate",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
