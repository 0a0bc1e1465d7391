"""What a run tells of its controller, and the fallback in the loop with the vehicle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loop_rig import write_scenario

from cosim.control.against_truth import against_truth
from cosim.control.damper_map import DamperMap
from cosim.control.figures import decisions, fallback_figures, fallback_shares
from cosim.errors import InputError
from cosim.recorder import Recorder, Signal
from cosim.run import Outcome, execute
from cosim.scenario.controllers import Fallback, Passive, Skyhook, TwoStateSkyhook
from cosim.scenario.load import load

CLASS_C = "{kind: iso8608, class: C}"
# Wheel speeds are lost from 3 s to 3.5 s; the estimate is invalid from 3.1 s to 2 s after
LOST = "[{kind: dropout, channels: wheel_speeds, share: 1, fill: nan, start_s: 3, end_s: 3.5}]"


def groups(*names: str) -> list[tuple[str, list[Signal]]]:
    return [(name, [Signal(f"{name}{i}", "") for i in range(4)]) for name in names]


# ---------------------------------------------------------------- decisions


def test_wrong_decisions_are_wrong_signs_of_a_moving_suspension() -> None:
    rows = [  # estimate, truth, valid
        ([0.1, -0.1, 0.01, 0.0], [0.1, 0.1, -0.019, 0.03], True),  # right, wrong, slow, wrong
        ([-0.3, 0.2, 0.2, 0.2], [-0.1, 0.5, 0.2, 0.1], True),  # all right
        ([np.nan] * 4, [0.5] * 4, False),  # no decision at all
    ]
    record = Recorder([*groups("estimate", "truth"), ("valid", [Signal("valid", "")])], 3)
    for k, (estimate, truth, valid) in enumerate(rows):
        record.append(k, estimate, truth, valid)
    found = decisions(Skyhook(kind="skyhook"), record)
    assert found == {"wrong_percent": pytest.approx(100 * 2 / 7)}
    assert decisions(Skyhook(kind="skyhook", feedback="truth"), record) == {"wrong_percent": 0.0}


def test_without_a_moving_suspension_nothing_is_decided() -> None:
    record = Recorder([*groups("estimate", "truth"), ("valid", [Signal("valid", "")])], 1)
    record.append(0, np.zeros(4), np.zeros(4), True)
    assert decisions(Skyhook(kind="skyhook"), record) == {}


# ---------------------------------------------------------------- beside the truth


def ride(acceleration: float, load: float, deflection: float) -> dict[str, Any]:
    return {"comfort": {
        "weighted_acceleration_m_s2": acceleration, "tyre_load_rms_n": load,
        "deflection_rms_m": deflection,
    }}  # fmt: skip


def test_the_gain_that_an_estimate_keeps() -> None:
    controllers = (
        Passive(kind="passive"),
        Skyhook(kind="skyhook", feedback="truth"),
        Skyhook(kind="skyhook", estimator="kalman"),
        Skyhook(kind="skyhook", gain_ns_per_m=2000.0, estimator="zero"),
        TwoStateSkyhook(kind="skyhook_two_state", feedback="truth"),
    )
    figures = {
        "passive": ride(0.6, 700.0, 0.006),
        "skyhook_truth": ride(0.4, 600.0, 0.008),
        "skyhook_kalman": ride(0.42, 612.0, 0.007),
        "skyhook_zero": ride(0.5, 600.0, 0.008),
        "skyhook_two_state_truth": ride(0.5, 600.0, 0.008),
    }
    found = against_truth(controllers, figures)
    assert found.keys() == {"skyhook_kalman"}  # another gain and another law are no twins
    assert found["skyhook_kalman"] == {
        "gain_kept_percent": pytest.approx(90.0),
        "tyre_load_percent": pytest.approx(2.0),
        "deflection_percent": pytest.approx(-12.5),
    }
    assert against_truth(controllers[1:], figures) == {}


def test_where_the_truth_gains_nothing_there_is_nothing_to_keep() -> None:
    controllers = (
        Passive(kind="passive"),
        Skyhook(kind="skyhook", feedback="truth"),
        Skyhook(kind="skyhook"),
    )
    labels = ("passive", "skyhook_truth", "skyhook_estimate")
    figures = dict(zip(labels, (ride(0.4, 1, 1), ride(0.395, 1, 1), ride(0.5, 1, 1)), strict=True))
    assert "gain_kept_percent" not in against_truth(controllers, figures)["skyhook_estimate"]


# ---------------------------------------------------------------- fallback in the loop


def driven(folder: Path, fade: float, damper_ms: int = 0) -> Outcome:
    """Skyhook on a linear filter, over a rough road at 50 km/h for 8 s."""
    fallback = f"{{fade_s: {fade}}}"
    controllers = f"[{{kind: skyhook, estimator: fir_residual_w19, fallback: {fallback}}}]"
    path = write_scenario(
        folder,
        duration="8",
        surface=CLASS_C,
        sections={
            "controllers": controllers,
            "faults": LOST,
            "latency": f"{{damper_ms: {damper_ms}}}",
        },
    )
    return execute(load(path), folder / "out")


def test_lost_channels_bring_the_safe_command_and_back(tmp_path: Path) -> None:
    run = driven(tmp_path, 0.4).runs[0]
    command, time = run.recorder.group("command"), run.recorder.time
    np.testing.assert_array_equal(command[time < 1.0], 0.3)  # until the first estimates are trusted
    np.testing.assert_allclose(command[(time > 3.6) & (time < 6.4)], 0.3)
    for acting in ((time > 1.8) & (time < 3.0), time > 7.0):
        assert command[acting].min() == 0.0
        assert command[acting].max() > 0.9
    found = run.figures["fallback"]
    shares = fallback_shares(Fallback(fade_s=0.4), run.recorder)
    assert found["active_percent"] == pytest.approx(100 * np.mean(shares > 0))
    assert found["times"] == 1.0


def test_the_plant_s_damper_force_has_no_step_while_the_command_fades(tmp_path: Path) -> None:
    """With a fade as short as a sample it has: the figure is able to fail."""
    slow, sudden = (
        driven(tmp_path, fade).runs[0].figures["fallback"]["force_step_n"] for fade in (0.5, 0.01)
    )
    assert slow < 120.0  # a quarter of the last step that the law made is still in the valve
    assert sudden > 5 * slow


def test_with_late_dampers_the_law_s_own_steps_are_not_the_fallback_s(tmp_path: Path) -> None:
    run = driven(tmp_path, 0.5, damper_ms=100).runs[0]
    of_the_law = fallback_figures(Fallback(fade_s=0.5), run.recorder, DamperMap())  # 0.1 s before
    assert run.figures["fallback"]["force_step_n"] < 0.5 * of_the_law["force_step_n"]


def test_an_uncertain_estimate_is_not_trusted(tmp_path: Path) -> None:
    controllers = (
        "[{kind: skyhook, estimator: kalman, fallback: {largest_deviation_m_s: 0.0001}}, "
        "{kind: skyhook, estimator: kalman, name: any, fallback: {largest_deviation_m_s: 9}}]"
    )
    path = write_scenario(
        tmp_path, duration="4", surface=CLASS_C, sections={"controllers": controllers}
    )
    never, always = execute(load(path), tmp_path / "out").runs
    assert (never.recorder.group("command") == 0.3).all()
    assert never.figures["fallback"]["active_percent"] == 100.0
    assert always.figures["fallback"]["active_percent"] < 60.0


def test_a_fallback_on_a_deviation_that_nobody_predicts_is_noted(tmp_path: Path) -> None:
    controllers = (
        "[{kind: skyhook, estimator: fir_residual_w19, fallback: {largest_deviation_m_s: 0.1}}, "
        "{kind: skyhook, estimator: fir_residual_w19, name: any, fallback: {}}, "
        "{kind: skyhook, estimator: kalman, fallback: {largest_deviation_m_s: 0.1}}]"
    )
    path = write_scenario(tmp_path, duration="2", sections={"controllers": controllers})
    assert execute(load(path), tmp_path / "out").notes == (
        "skyhook_fir_residual_w19: fallback.largest_deviation_m_s never acted: the sensor predicts "
        "no deviation",
    )


def test_a_fallback_is_for_estimates_alone(tmp_path: Path) -> None:
    wrong = {
        "{kind: skyhook, feedback: truth, fallback: {}}": "the truth is always valid",
        "{kind: skyhook, initial_command: 0.1, fallback: {}}": "leave initial_command out",
        "{kind: skyhook, fallback: {fade_s: 0}}": "fade_s must be at least 0.01 s",
        "{kind: passive, fallback: {}}": "'fallback' is not a field",
    }
    for controller, words in wrong.items():
        path = write_scenario(tmp_path, sections={"controllers": f"[{controller}]"})
        with pytest.raises(InputError, match=words):
            load(path)
