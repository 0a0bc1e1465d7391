"""The body's motion from the IMU: against analytic filters, rigid-body motions, and the vehicle."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from loop_rig import Blind
from scipy import signal

from cosim.assembly import assemble
from cosim.control.biquad import Biquad
from cosim.control.body import Body, Lean
from cosim.scenario.load import load
from sensor.channels import CHANNEL_NAMES

Array = npt.NDArray[np.float64]

H = 0.01
AX, AY, AZ, P, Q, R = range(6)
SCENARIOS = Path(__file__).parents[1] / "scenarios"


def followed(channels: Array, body: Body | None = None) -> tuple[Array, Array, Array]:
    """Modes (n, 3), corner velocities and accelerations (n, 4) for channels (n, 6)."""
    body = body or Body()
    row, found = np.zeros(len(CHANNEL_NAMES)), []
    for now in channels:
        row[:6] = now
        body.step(row)
        found.append((body.modes.copy(), body.velocity.copy(), body.acceleration.copy()))
    modes, velocity, acceleration = zip(*found, strict=True)
    return np.array(modes), np.array(velocity), np.array(acceleration)


# ---------------------------------------------------------------- filters


@pytest.mark.parametrize(
    ("numerator", "denominator"),
    [
        ((0.0, 1.0, 0.0), (1.0, 1.8, 1.6)),
        ((94.0, 0.0, 0.0), (1.0, 94.6, 30.0)),
        ((0.0, 0.0, 12.6), (0.0, 1.0, 12.6)),
    ],
)
def test_a_biquad_is_scipys_bilinear_filter(
    numerator: tuple[float, float, float], denominator: tuple[float, float, float]
) -> None:
    x = np.random.default_rng(1).standard_normal(300)
    biquad = Biquad(numerator, denominator, 100.0)
    b, a = signal.bilinear(numerator, denominator, 100.0)
    np.testing.assert_allclose([biquad.step(v) for v in x], signal.lfilter(b, a, x), atol=1e-9)


def test_a_settled_biquad_stays_where_a_constant_leaves_it() -> None:
    for numerator, expected in (((0.0, 0.0, 3.0), 6.0), ((2.0, 5.0, 0.0), 0.0)):
        biquad = Biquad(numerator, (1.0, 0.7, 1.0))
        biquad.settle(2.0)
        assert [biquad.step(2.0) for _ in range(5)] == pytest.approx([expected] * 5)


def test_a_filter_without_a_settled_state_is_refused() -> None:
    with pytest.raises(ValueError, match="no settled state"):
        Biquad((1.0, 0.0, 0.0), (1.0, 1.0, 0.0))


# ---------------------------------------------------------------- rigid-body motions


@pytest.mark.parametrize("hz", [0.6, 1.3, 4.0])
def test_heave_is_the_integral_behind_a_butterworth_high_pass(hz: float) -> None:
    t = H * np.arange(6000)
    w, corner = 2 * np.pi * hz, 2 * np.pi * 0.2
    channels = np.zeros((len(t), 6))
    channels[:, AZ] = 0.1 * w * np.cos(w * t)  # v_z = 0.1 sin(w t)
    modes, velocity, acceleration = followed(channels)
    response = -w * w / (-w * w + np.sqrt(2) * corner * 1j * w + corner**2)
    late = slice(4000, None)
    expected = np.imag(0.1 * response * np.exp(1j * w * t))
    np.testing.assert_allclose(modes[late, 0], expected[late], atol=0.0008)
    np.testing.assert_allclose(velocity[late], np.tile(expected[late, None], 4), atol=0.0008)
    np.testing.assert_allclose(
        acceleration[200:-1, 0], np.gradient(velocity[:, 0], H)[200:-1], atol=0.02 * 0.1 * w
    )


def test_roll_and_pitch_move_the_corners_as_a_rigid_body() -> None:
    """Right side down is roll, nose down is pitch: ISO 8855."""
    t = H * np.arange(3000)
    rate = 0.1 * np.sin(2 * np.pi * 1.4 * t)
    levers = {P: (0.778, -0.847, 0.778, -0.847), Q: (-1.439, -1.439, 1.236, 1.236)}
    for channel, places in levers.items():
        channels = np.zeros((len(t), 6))
        channels[:, channel] = rate
        _, velocity, acceleration = followed(channels)
        for corner, lever in enumerate(places):
            assert velocity[2000:, corner] == pytest.approx(lever * rate[2000:], abs=0.006)
            slope = np.gradient(velocity[:, corner], H)
            error = acceleration[2000:-1, corner] - slope[2000:-1]
            assert np.std(error) < 0.12 * np.std(slope[2000:])  # the lag of 15 Hz


def test_nothing_of_an_offset_stays() -> None:
    """An offset of every channel, from the start or from some time on: a grade, a warm sensor."""
    channels = np.zeros((4000, 6))
    channels[:] = [0.3, -0.4, 0.5, 0.05, -0.04, 0.06]
    assert np.abs(followed(channels)[1]).max() < 1e-12
    channels[:1000] = 0.0
    modes, velocity, acceleration = followed(channels)
    assert np.abs(modes[-1]).max() < 1e-4
    assert np.abs(velocity[-1]).max() < 1e-4
    assert np.abs(acceleration[-1]).max() < 1e-4


def test_a_steady_bend_is_no_motion_of_the_body() -> None:
    """A body that leans by phi and yaws at r pitches, in its own axes, at r sin(phi), and its a_z
    is -a_y tan(phi): entered within half a second, all of it is gone at once with the lean known.
    """
    lean, speed, lateral = 0.011, 20.0, 7.0
    t = H * np.arange(600)
    share = np.clip((t - 1.0) / 0.5, 0.0, 1.0)
    ay = lateral * share
    phi, r = lean * ay, ay / speed
    channels = np.zeros((len(t), 6))
    channels[:, AY], channels[:, AZ] = ay, -ay * np.tan(phi)
    channels[:, P], channels[:, Q], channels[:, R] = np.gradient(phi, H), r * np.sin(phi), r
    known = followed(channels)[0]
    unknown = followed(channels, Body(lean=Lean(0.0, 0.0)))[0]
    assert np.abs(known[:, 0]).max() < 0.3 * np.abs(unknown[:, 0]).max()
    assert np.abs(known[:, 2]).max() < 0.3 * np.abs(unknown[:, 2]).max()
    assert np.abs(unknown[:, 0]).max() > 0.15


# ---------------------------------------------------------------- the vehicle


@pytest.mark.parametrize("condition", ["ideal", "production"])
def test_in_a_double_lane_change_the_corners_move_as_told(condition: str) -> None:
    """Against the vehicle's own height, roll and pitch, above 0.2 Hz without any phase: the error
    of the corner's velocity is below a third of the velocity itself, and the sign is right.
    """
    path = SCENARIOS / "paper" / "double_lane_change_030_kmh.yaml"
    fast = ["driver.speed_kmh=55", "road.surface=B", f"sensor.condition={condition}"]
    built = assemble(scenario := load(path, fast), scenario.controllers[0], Blind())
    built.run(None)
    record = built.recorder
    pose = record.columns(["Car.tz", "Car.Roll", "Car.Pitch"])
    true = np.gradient(pose, H, axis=0) @ Body().mixing.T
    high_pass = signal.butter(2, 0.2 / 50, "high", output="sos")
    true = signal.sosfiltfilt(high_pass, true, axis=0)[200:-100]
    found = followed(record.group("channels")[:, :6])[1][200:-100]
    assert np.sqrt(np.mean((found - true) ** 2)) < 0.34 * np.sqrt(np.mean(true**2))
    fast_ones = np.abs(true) > 0.05
    assert np.mean((found * true < 0)[fast_ones]) < 0.02
