"""The estimators by name: what a scenario, an evaluation or a table may choose from.

A trained or fitted estimator has one file for each measurement condition,
`sensor/models/<name>_<condition>.onnx|npz`; one that has a file for `ideal` only is used in both.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sensor.conditions import CONDITIONS, Condition
from sensor.errors import SensorError

if TYPE_CHECKING:
    from sensor.estimator import Estimator

DEFAULT: Final = "carried"
MODELS: Final = Path(__file__).parent / "models"


@dataclass(frozen=True)
class Fitted:
    """An estimator that is read from a file: its ending, the conditions that it has files for, and
    what reads one.
    """

    ending: str
    read: Callable[[Path], "Estimator"]
    conditions: tuple[Condition, ...] = CONDITIONS


def open_network(path: Path) -> "Estimator":
    """Open a network file, windowed or with carried state, as its metadata say.

    Raises SensorError if it is none or its channels, units or rate are not this sensor's.
    """
    from sensor.carried.runtime import CarriedSensor
    from sensor.runtime import OnnxSensor, open_session, read_info

    carried = read_info(open_session(path), str(path)).kind == "carried"
    return CarriedSensor(path) if carried else OnnxSensor(path)


def _fir(path: Path) -> "Estimator":
    from sensor.baselines import FirFilter

    return FirFilter.load(path)


def _kalman(path: Path) -> "Estimator":
    from sensor.kalman.filter import KalmanFilter

    return KalmanFilter.load(path)


def _zero(_: Condition) -> "Estimator":
    from sensor.baselines import Zero

    return Zero()


def _body_motion(_: Condition) -> "Estimator":
    from sensor.baselines import StillWheels

    return StillWheels()


_ESTIMATORS: Final[Mapping[str, Fitted | Callable[[Condition], "Estimator"]]] = {
    "zero": _zero,
    "body_motion": _body_motion,
    "fir_w19": Fitted(".npz", _fir),
    "fir_w64": Fitted(".npz", _fir),
    "fir_residual_w19": Fitted(".npz", _fir),
    "fir_residual_w64": Fitted(".npz", _fir),
    "kalman_imu": Fitted(".npz", _kalman),
    "kalman_wheels": Fitted(".npz", _kalman),
    "kalman_delay": Fitted(".npz", _kalman),
    "kalman": Fitted(".npz", _kalman),
    "bilstm_w19": Fitted(".onnx", open_network, ("ideal",)),
    "bilstm_residual_w19": Fitted(".onnx", open_network),
    "carried": Fitted(".onnx", open_network),
}


def names() -> tuple[str, ...]:
    """Return the names that `make` knows."""
    return tuple(_ESTIMATORS)


def make(name: str, condition: Condition) -> "Estimator":
    """Return the estimator for channels measured under `condition`, fresh.

    Raises SensorError for an unknown name, and where its file is not shipped or does not fit.
    """
    entry = _entry(name)
    if not isinstance(entry, Fitted):
        return entry(condition)
    return entry.read(_file(name, entry, condition))


def model_file(name: str, condition: Condition) -> Path | None:
    """Return the file that `make` reads, None for an estimator without one; raises SensorError for
    an unknown name or a file that is not there.
    """
    entry = _entry(name)
    return _file(name, entry, condition) if isinstance(entry, Fitted) else None


def _entry(name: str) -> Fitted | Callable[[Condition], "Estimator"]:
    if name not in _ESTIMATORS:
        raise SensorError(f"there is no estimator {name!r}; there are {', '.join(names())}.")
    return _ESTIMATORS[name]


def _file(name: str, entry: Fitted, condition: Condition) -> Path:
    fitted_for = condition if condition in entry.conditions else entry.conditions[0]
    path = MODELS / f"{name}_{fitted_for}{entry.ending}"
    if not path.is_file():
        raise SensorError(
            f"{path}: estimator {name!r} is not shipped for condition {condition}; train it "
            "(cosim sensor train) or choose another."
        )
    return path
