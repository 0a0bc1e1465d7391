"""Dampers at one command, and dampers that switch at random."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from control_rig import sample

from cosim.control.fixed import FixedDampers
from cosim.control.switching import SwitchingDampers

Array = npt.NDArray[np.float64]

H = 0.01


@pytest.mark.parametrize("command", [0.0, 0.4, 1.0])
def test_fixed_dampers_stay(command: float) -> None:
    dampers = FixedDampers(command)
    for _ in range(3):
        assert dampers.step(sample()).tolist() == [command] * 4


def switched(seed: int, samples: int = 20_000) -> Array:
    """Commands (samples, 4) of 200 s."""
    dampers = SwitchingDampers(seed, H)
    return np.array([dampers.step(sample()).copy() for _ in range(samples)])


def test_switching_is_given_by_the_seed_alone() -> None:
    np.testing.assert_array_equal(switched(3), switched(3))
    assert not np.array_equal(switched(3), switched(4))


def test_switching_covers_the_whole_range_and_both_ends() -> None:
    commands = switched(1)
    assert commands.min() == 0.0
    assert commands.max() == 1.0
    for column in commands.T:
        shares = [(column == 0.0).mean(), (column == 1.0).mean()]
        assert min(shares) > 0.15
        assert max(shares) < 0.35
        inner = column[(column > 0.0) & (column < 1.0)]
        assert 0.3 < len(inner) / len(column) < 0.7
        assert inner.mean() == pytest.approx(0.5, abs=0.06)


def test_switching_holds_each_command_for_a_while() -> None:
    """0.05 s to 1 s; the same end may come twice in a row, so only inner values show it."""
    spans = []
    for column in switched(2).T:
        (changes,) = np.nonzero(np.diff(column))
        starts = np.concatenate([[0], changes + 1, [len(column)]])
        spans += [
            length
            for start, length in zip(starts[1:-1], np.diff(starts)[1:], strict=True)
            if 0.0 < column[start] < 1.0 and start + length < len(column)
        ]
    assert len(spans) > 100
    assert min(spans) >= 0.05 / H
    assert max(spans) <= 1.0 / H
    assert np.mean(spans) * H == pytest.approx(0.525, abs=0.06)


def test_dampers_switch_each_for_itself() -> None:
    commands = switched(1)
    correlation = np.corrcoef(commands.T) - np.eye(4)
    assert np.abs(correlation).max() < 0.25
