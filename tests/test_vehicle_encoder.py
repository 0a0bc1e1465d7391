"""The wheel-speed sensor's teeth (fmu/vehicle/encoder.c): what a brake controller would read."""

from __future__ import annotations

import numpy as np
import pytest
from gates import at_most, gate
from plant_probe import Array, Probe
from scipy.optimize import brentq
from vehicle_rig import run, straight_track

from cosim.road import Iso8608, build_road

TEETH, H, STEPS = 48, 0.001, 10
PITCH = 2 * np.pi / TEETH
T = STEPS * H  # between two readings [s]


@pytest.fixture(scope="module")
def probe() -> Probe:
    return Probe({"Sensor.WheelSpd.Teeth": TEETH})


def times(seconds: float) -> Array:
    return np.arange(round(seconds / H) + 1) * H


def test_an_even_turn_is_read_exactly(probe: Probe) -> None:
    t = times(2.0)
    for speed in (-80.0, 5.3, 47.1):
        readings = probe.encoder(speed * t, STEPS, H)
        np.testing.assert_allclose(readings[10:], speed, rtol=1e-9)


def test_readings_are_teeth_over_the_time_between_edges(probe: Probe) -> None:
    """The edges' times, found by root finding on the true motion, are the oracle."""

    def angle(t: float) -> float:
        return 40.0 * t + 0.02 * np.sin(2 * np.pi * 11.0 * t)

    t = times(1.0)
    readings = probe.encoder(40.0 * t + 0.02 * np.sin(2 * np.pi * 11.0 * t), STEPS, H)
    edges = [
        brentq(lambda s, n=n: angle(s) - n * PITCH, 0.0, 1.1) for n in range(round(40 / PITCH))
    ]
    for n in range(10, len(readings)):
        last, earlier = (np.searchsorted(edges, m * T, side="right") - 1 for m in (n + 1, n))
        expected = (last - earlier) * PITCH / (edges[last] - edges[earlier])
        assert readings[n] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("frequency", [2.0, 5.0, 15.0, 25.0, 40.0])
def test_the_response_is_that_of_a_moving_average(probe: Probe, frequency: float) -> None:
    """Amplitude |sin(pi f T) / (pi f T)|, T the time between readings, at 70 km/h."""
    t, ripple = times(60.0), 0.5
    frequency += 0.0371  # no beat with the samples
    omega = 2 * np.pi * frequency
    readings = probe.encoder(55.0 * t + ripple / omega * np.sin(omega * t), STEPS, H)[100:]
    at = (np.arange(len(readings)) + 101) * T
    basis = np.column_stack([np.cos(omega * at), np.sin(omega * at), np.ones_like(at)])
    cosine, sine, mean = np.linalg.lstsq(basis, readings, rcond=None)[0]
    expected = abs(np.sinc(frequency * T))
    off = abs(np.hypot(cosine, sine) / ripple / expected - 1)
    check = f"wheel-speed sensor, 48 teeth: amplitude at {frequency:.0f} Hz, off by [-]"
    gate("Sampling", check, "moving average over 10 ms, |sinc|", off, at_most(0.02))
    assert mean == pytest.approx(55.0, rel=1e-4)
    delay = np.arctan2(sine, cosine) / omega
    assert delay == pytest.approx(T / 2 + PITCH / 55.0 / 2, abs=5e-4)  # half a window, half a tooth


def test_a_wheel_that_stops_is_read_as_ever_slower(probe: Probe) -> None:
    t = times(2.0)
    readings = probe.encoder(np.minimum(10.0 * t, 10.0), STEPS, H)
    assert readings[95] == pytest.approx(10.0)
    assert (np.diff(readings[102:]) < 0).all()
    assert readings[-1] == pytest.approx(PITCH / 1.0, rel=0.2)


def test_backwards_is_negative(probe: Probe) -> None:
    t = times(2.0)
    readings = probe.encoder(3.0 * np.cos(np.pi * t), STEPS, H)  # forwards after t = 1
    assert (readings[20:90] < 0).all()
    assert (readings[120:190] > 0).all()


def test_without_teeth_the_sensor_is_ideal_and_with_them_close(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    road = build_road(straight_track(100.0), Iso8608("B", 1), tmp_path_factory.mktemp("road"))
    start = {"Init.Velocity": 15.0, "Road.File": str(road)}
    ideal = run(3.0, start)
    np.testing.assert_array_equal(
        ideal.corners("Sensor.WheelSpd_@"), ideal.corners("Car.WheelSpd_@")
    )
    real = run(3.0, {**start, "Sensor.WheelSpd.Teeth": 48.0})
    np.testing.assert_array_equal(real.corners("Car.WheelSpd_@"), ideal.corners("Car.WheelSpd_@"))
    off = (real.corners("Sensor.WheelSpd_@") - ideal.corners("Car.WheelSpd_@"))[20:]
    assert 0 < np.abs(off).max() < 0.5
    assert np.abs(real["Sensor.Esc.vx"] - real["Car.vx"])[20:].max() < 0.3
