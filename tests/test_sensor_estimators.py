"""Every estimator of the registry offers the same: stepping, whole runs, reset."""

from pathlib import Path

import numpy as np
import pytest

from sensor import estimators
from sensor.conditions import CONDITIONS
from sensor.errors import SensorError
from sensor.estimators import make, model_file, names

RANDOM = np.random.default_rng(3)
SAMPLES = RANDOM.normal(0.0, 0.1, (150, 14)) + 10.0 * np.isin(np.arange(14), [6, 9, 10, 11, 12])
COMMANDS = RANDOM.uniform(size=(150, 4))


def shipped() -> list[tuple[str, str]]:
    found = []
    for name in names():
        for condition in CONDITIONS:
            try:
                model_file(name, condition)
            except SensorError:
                continue
            found.append((name, condition))
    return found


@pytest.mark.parametrize(("name", "condition"), shipped())
def test_stepping_equals_a_whole_run(name: str, condition: str) -> None:
    estimator = make(name, "ideal" if condition == "ideal" else "production")
    expected = estimator.apply(SAMPLES, COMMANDS)
    estimate, deviation = estimator.estimate, estimator.deviation
    assert expected.shape == (150, 4)
    for _ in range(2):
        for k, sample in enumerate(SAMPLES):
            valid = estimator.step(sample, COMMANDS[k])
            assert valid == np.isfinite(expected[k]).all()
            np.testing.assert_allclose(estimate, expected[k], rtol=0.0, atol=1e-6)
        assert valid
        assert estimator.estimate is estimate
        assert estimator.deviation is deviation
        assert deviation.shape == (4,)
        estimator.reset()
        assert np.isnan(estimate).all()


def test_the_paper_s_network_serves_both_conditions() -> None:
    assert model_file("bilstm_w19", "production") == model_file("bilstm_w19", "ideal")
    assert model_file("zero", "ideal") is None


def test_unknown_and_missing_estimators(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SensorError, match="no estimator 'fir'; there are zero, body_motion"):
        make("fir", "ideal")
    monkeypatch.setattr(estimators, "MODELS", tmp_path)
    with pytest.raises(
        SensorError, match=r"fir_w64_ideal\.npz: estimator 'fir_w64' is not shipped"
    ):
        make("fir_w64", "ideal")
