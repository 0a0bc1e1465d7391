"""The fallback: when the estimate is trusted, how the command fades, and no step in any force."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from control_rig import sample
from hypothesis import given
from hypothesis import strategies as st

from cosim.control.fallback import Fade, Fallback, FallbackParameters
from cosim.control.sample import Sample

Array = npt.NDArray[np.float64]

SAFE = 0.3


class Restless:
    """A controller that commands hard and soft in turn, for as long as its estimate is valid."""

    def __init__(self) -> None:
        self.command = np.zeros(4)
        self._k = 0

    def step(self, known: Sample) -> Array:
        self._k += 1
        if known.valid:
            self.command[:] = [1.0, 0.0, float(self._k % 2), 0.5]
        return self.command


def commanded(trusted: list[bool], **parameters: float) -> Array:
    """Commands (n, 4) for estimates that are valid or not."""
    fallback = Fallback(Restless(), FallbackParameters(SAFE, **parameters))
    estimate = np.full(4, 0.1)
    return np.array([fallback.step(sample(None, estimate, t)).copy() for t in trusted])


def test_it_begins_safe_and_fades_to_the_law_in_a_straight_line() -> None:
    found = commanded([False] * 5 + [True] * 60, fade=0.2, back_after=0.1)
    np.testing.assert_allclose(found[:15], SAFE)
    np.testing.assert_allclose(found[14:36, 0], np.interp(range(22), [0, 20, 21], [SAFE, 1, 1]))
    np.testing.assert_allclose(found[14:36, 1], np.interp(range(22), [0, 20, 21], [SAFE, 0, 0]))
    assert found[36:, 2].tolist() in ([1.0, 0.0] * 14 + [1.0], [0.0, 1.0] * 14 + [0.0])


def test_the_last_trusted_command_fades_to_the_safe_one() -> None:
    found = commanded([True] * 100 + [False] * 40, fade=0.2, back_after=0.1)
    for wheel, last in ((0, 1.0), (1, 0.0), (2, found[99, 2]), (3, 0.5)):
        expected = np.interp(np.arange(41), [0, 20], [last, SAFE])
        np.testing.assert_allclose(found[99:, wheel], expected)


def test_it_waits_until_the_estimate_was_trusted_without_a_break() -> None:
    """One sample missing now and then keeps the dampers safe."""
    found = commanded([True, True, True, False] * 100, fade=0.05, back_after=0.04)
    np.testing.assert_allclose(found, SAFE)


@pytest.mark.parametrize(
    ("deviation", "trusted"),
    [(0.05, True), (0.0999, True), (0.11, False), (np.nan, True)],
)
@pytest.mark.parametrize("first", [0.01, np.nan])
def test_a_deviation_at_one_wheel_decides(deviation: float, trusted: bool, first: float) -> None:
    parameters = FallbackParameters(SAFE, largest_deviation=0.1, fade=0.01, back_after=0.0)
    fallback = Fallback(Restless(), parameters)
    expected = np.array([first, 0.02, deviation, 0.01])
    for _ in range(5):
        known = sample(None, np.full(4, 0.1), True, None, expected)
        found = fallback.step(known)
    assert (found[0] == 1.0) == trusted


def test_while_it_is_safe_the_controller_follows() -> None:
    """Its filters have to know the motion when it is heard again."""
    controller = Restless()
    fallback = Fallback(controller, FallbackParameters(SAFE))
    for _ in range(7):
        fallback.step(sample())
    assert controller._k == 7


@given(
    st.lists(st.tuples(st.booleans(), st.integers(1, 60)), max_size=12),
    st.integers(1, 50),
    st.integers(0, 50),
)
def test_whatever_happens_the_command_never_jumps_while_it_fades(
    spans: list[tuple[bool, int]], fade: int, back_after: int
) -> None:
    """The law's own steps count with the share that it has; the fade adds its own at most."""
    trusted = [t for t, length in spans for _ in range(length)]
    fading = Fade(fade / 100, back_after / 100)
    shares = np.array([1.0, *(fading.step(t) for t in trusted)])
    assert np.abs(np.diff(shares)).max(initial=0.0) <= 1 / fade + 1e-12
    found = commanded(trusted, fade=fade / 100, back_after=back_after / 100)
    both = np.vstack([np.full(4, SAFE), found]) if trusted else np.full((1, 4), SAFE)
    steady = np.abs(np.diff(both[:, [0, 1, 3]], axis=0))  # wheels whose law does not change
    assert steady.max(initial=0.0) <= 0.7 / fade + 1e-12
    assert ((found >= 0) & (found <= 1)).all()
