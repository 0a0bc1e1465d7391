"""From a scenario's settings to its sensor: the measurement of the channels and the estimator."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from cosim.errors import NetworkError, Problem
from cosim.wiring import Wiring
from sensor import SensorError
from sensor.channels import STAGE
from sensor.conditions import Measurement
from sensor.estimators import make, model_file, open_network

if TYPE_CHECKING:
    from cosim.scenario.schema import Scenario
    from cosim.scenario.sensor import Sensor
    from sensor.estimator import Estimator


def estimator_file(scenario: Scenario, settings: Sensor) -> Path | None:
    """Return the file of a sensor's network or estimator, None for an estimator without one;
    raises `NetworkError` where none is shipped.
    """
    file = settings.network or settings.fmu
    if file is not None:
        return scenario.resolve(file)
    try:
        return model_file(str(settings.estimator), settings.condition)
    except SensorError as error:
        raise NetworkError(str(error)) from None


def estimator_of(scenario: Scenario, settings: Sensor) -> Estimator:
    """Return a sensor's estimator, fresh; raises `NetworkError` or `FmuError` where its file does
    not fit.
    """
    if settings.fmu is not None:
        from cosim.sensor_fmu import FmuSensor

        return FmuSensor(scenario.resolve(settings.fmu))
    try:
        if settings.network is None:
            return make(str(settings.estimator), settings.condition)
        return open_network(scenario.resolve(settings.network))
    except SensorError as error:
        raise NetworkError(str(error)) from None


def measurement_of(scenario: Scenario) -> Measurement:
    """Return how the scenario's channels are measured; its seed decides offsets and noise."""
    return Measurement(scenario.sensor.condition, scenario.seed)


def stage_problems(scenario: Scenario, wiring: Wiring, fmu: str) -> list[Problem]:
    """Return what a vehicle FMU lacks for condition production: the signals of its sensors."""
    if scenario.sensor.condition != "production":
        return []
    wired = {wire.quantity.name for wire in wiring.outputs}
    missing = [signal.name for signal in STAGE if signal.name not in wired]
    if not missing:
        return []
    sentence = (
        f"condition production needs what the vehicle's sensors deliver, and '{fmu}' has no "
        f"{', '.join(missing)}; map them under vehicle.variables, or take condition ideal"
    )
    return [scenario.problem(("sensor", "condition"), sentence)]
