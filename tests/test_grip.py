"""Shares of grip, from the signal to the figures."""

from __future__ import annotations

import numpy as np
import pytest

from cosim.grip import grip_figures


def test_peak_and_mean_of_each_tyre_in_percent() -> None:
    share = np.array([[0.1, 0.2, 0.3, 0.4], [0.5, 0.2, 0.1, 0.0], [0.3, 0.2, 0.2, 1.1]])
    found = grip_figures(share)
    assert list(found) == ["FL", "FR", "RL", "RR"]
    assert found["FL"] == pytest.approx({"peak_percent": 50.0, "mean_percent": 30.0})
    assert found["RR"] == pytest.approx({"peak_percent": 110.0, "mean_percent": 50.0})


def test_a_vehicle_that_does_not_tell_has_no_figures() -> None:
    assert grip_figures(np.full((5, 4), np.nan)) == {}
    assert grip_figures(np.zeros((0, 4))) == {}
