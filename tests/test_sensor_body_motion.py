import numpy as np
import numpy.typing as npt
import pytest

from sensor.body_motion import BodyMotion, Geometry
from sensor.channels import CHANNEL_NAMES

Array = npt.NDArray[np.float64]
H = 0.01
TIME = np.arange(4000) * H
SETTLED = TIME > 25.0


def channels(**signals: Array) -> Array:
    samples = np.zeros((len(TIME), len(CHANNEL_NAMES)))
    for name, values in signals.items():
        samples[:, CHANNEL_NAMES.index(f"Car.{name}")] = values
    return samples


def high_passed(amplitude: float, frequency: float, corner: float = 0.2) -> Array:
    """Steady response of the documented high-pass to amplitude * sin(2 pi f t)."""
    s, w = 2j * np.pi * frequency, 2 * np.pi * corner
    gain = s**2 / (s**2 + np.sqrt(2) * w * s + w**2)
    return np.imag(amplitude * gain * np.exp(2j * np.pi * frequency * TIME))


@pytest.mark.parametrize("frequency", [0.5, 1.2, 3.0])
def test_heave_moves_all_corners_alike(frequency: float) -> None:
    omega = 2 * np.pi * frequency
    velocity = BodyMotion().apply(channels(az=0.2 * omega * np.cos(omega * TIME)))
    expected = high_passed(0.2, frequency)
    for corner in velocity.T:
        np.testing.assert_allclose(corner[SETTLED], expected[SETTLED], atol=0.2 * 0.005)


def test_roll_and_pitch_act_through_the_lever_arms() -> None:
    geometry = Geometry()
    expected = high_passed(0.1, 1.2)[SETTLED]
    rate = 0.1 * np.sin(2 * np.pi * 1.2 * TIME)
    roll = BodyMotion(geometry).apply(channels(RollVel=rate))[SETTLED]
    pitch = BodyMotion(geometry).apply(channels(PitchVel=rate))[SETTLED]
    left, right = geometry.left_y, geometry.right_y
    ahead, behind = -geometry.front_x, -geometry.rear_x  # nose down: the front goes down
    for i, arm in enumerate((left, right, left, right)):
        np.testing.assert_allclose(roll[:, i], arm * expected, atol=1e-3)
    for i, arm in enumerate((ahead, ahead, behind, behind)):
        np.testing.assert_allclose(pitch[:, i], arm * expected, atol=1e-3)


def test_lead_at_body_frequency_is_as_documented() -> None:
    phase = np.angle(np.fft.rfft(high_passed(1.0, 1.2)[:2500] * np.hanning(2500))[30])
    pure = np.angle(np.fft.rfft(np.sin(2 * np.pi * 1.2 * TIME[:2500]) * np.hanning(2500))[30])
    assert np.degrees(phase - pure) == pytest.approx(13.6, abs=0.3)


def test_constant_acceleration_and_rates_leave_nothing() -> None:
    """A banked curve or an offset present from the start, and one that begins on the way."""
    constant = np.full(len(TIME), 0.5)
    velocity = BodyMotion().apply(channels(az=constant, RollVel=constant, PitchVel=-constant))
    np.testing.assert_allclose(velocity, 0.0, atol=1e-12)
    velocity = BodyMotion().apply(channels(az=np.where(TIME > 5.0, 0.5, 0.0)))
    assert np.abs(velocity[SETTLED]).max() < 1e-3


def test_streaming_equals_batch_and_reset_starts_afresh() -> None:
    samples = np.random.default_rng(1).normal(size=(500, 14))
    body = BodyMotion()
    batch = body.apply(samples)
    for _ in range(2):
        streamed = np.array([body.step(sample).copy() for sample in samples])
        np.testing.assert_allclose(streamed, batch, rtol=0.0, atol=1e-12)
        body.reset()
