"""Manoeuvres with the package's own car, from the scenario to its figures."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from loop_rig import Blind

from cosim.assembly import RunResult, assemble
from cosim.errors import InputError
from cosim.metrics import MANOEUVRE_FIGURES
from cosim.recorder import Recorder
from cosim.scenario.load import load


def scenario(folder: Path, kmh: float, manoeuvre: str, road: str = "{track: straight}") -> Path:
    path = folder / "scenario.yaml"
    path.write_text(
        f"name: a manoeuvre\nroad: {road}\ndriver: {{speed_kmh: {kmh}}}\n"
        f"manoeuvre: {{{manoeuvre}}}\n"
    )
    return path


def drive(path: Path, *overrides: str) -> tuple[RunResult, Recorder]:
    settings = load(path, overrides)
    built = assemble(settings, settings.controllers[0], sensor=Blind())
    return built.run(None), built.recorder


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """Run a manoeuvre, each only once."""

    @cache
    def run(kmh: float, manoeuvre: str, road: str = "{track: straight}") -> Any:
        return drive(scenario(tmp_path_factory.mktemp("run"), kmh, manoeuvre, road))

    return run


R60 = "{track: circle, radius_m: 60, direction: right}"
KINDS = [
    pytest.param(40, "kind: constant_speed", "{track: straight, length_m: 80}", id="speed"),
    pytest.param(75, "kind: constant_radius", R60, id="radius"),
    pytest.param(30, "kind: double_lane_change", "{track: straight}", id="lane change"),
    pytest.param(35, "kind: slalom, spacing_m: 18, cones: 4", "{track: straight}", id="slalom"),
    pytest.param(60, "kind: sine_with_dwell, amplitude_deg: 60", "{track: straight}", id="dwell"),
    pytest.param(80, "kind: step_steer, amplitude_deg: 30", "{track: straight}", id="step"),
    pytest.param(50, "kind: brake, deceleration_m_s2: 4", "{track: straight}", id="brake"),
    pytest.param(20, "kind: accelerate, pedal: 0.5, to_kmh: 50", "{track: straight}", id="gas"),
]


@pytest.mark.parametrize(("kmh", "manoeuvre", "road"), KINDS)
def test_a_manoeuvre_ends_by_itself_with_all_of_its_figures(
    driven: Any, kmh: float, manoeuvre: str, road: str
) -> None:
    result, recorder = driven(kmh, manoeuvre, road)
    kind = manoeuvre.split(",")[0].removeprefix("kind: ")
    assert result.finish_reason == "end of the manoeuvre"
    assert result.lap_time_s == pytest.approx(recorder.time[-1])
    assert set(result.manoeuvre) == set(MANOEUVRE_FIGURES[kind])
    assert np.isfinite(list(result.manoeuvre.values())).all()


def test_the_circle_is_driven_at_its_radius_and_speed(driven: Any) -> None:
    result, _ = driven(75, "kind: constant_radius", R60)
    found = result.manoeuvre
    assert found["path_deviation_m"] < 0.1
    assert found["speed_deviation_kmh"] < 0.5
    assert found["lateral_acceleration_m_s2"] == pytest.approx((75 / 3.6) ** 2 / 60, rel=0.01)
    assert found["yaw_rate_deg_s"] == pytest.approx(np.degrees(75 / 3.6 / 60), rel=0.01)
    assert found["side_slip_deg"] < -1.5  # the nose points into the bend
    assert found["steering_wheel_deg"] > 16.5 * np.degrees(2.675 / 60)  # it understeers


@pytest.mark.parametrize("kmh", [20, 30, 50])
def test_the_car_passes_the_gates_of_iso_3888_2(driven: Any, kmh: float) -> None:
    result, recorder = driven(kmh, "kind: double_lane_change")
    found = result.manoeuvre
    assert found["clearance_m"] > 0.0
    assert found["entry_speed_kmh"] == pytest.approx(kmh, abs=0.1)
    assert found["path_deviation_m"] < 0.1
    pedals = recorder.group("driver")[recorder.group("vehicle")[:, 0] > 2 * kmh / 3.6 + 2.0, 1:]
    assert len(pedals) > 200
    assert not pedals.any()  # released within 2 m of the entry


@pytest.mark.parametrize("kmh", [15, 35])
def test_the_slalom_is_driven_clear_of_the_cones(driven: Any, kmh: float) -> None:
    found = driven(kmh, "kind: slalom, spacing_m: 18, cones: 4")[0].manoeuvre
    assert found["clearance_m"] == pytest.approx(0.45, abs=0.1)
    assert found["speed_mean_kmh"] == pytest.approx(kmh, abs=0.2)


def test_yaw_rate_is_gone_after_the_sine_with_dwell(driven: Any) -> None:
    result, recorder = driven(60, "kind: sine_with_dwell, amplitude_deg: 60")
    found = result.manoeuvre
    assert abs(found["yaw_rate_after_1_00_s_percent"]) < 35
    assert abs(found["yaw_rate_after_1_75_s_percent"]) < 20
    assert found["lateral_displacement_m"] > 0.5
    steer = np.degrees(recorder.group("driver")[:, 0])
    assert steer.max() == pytest.approx(60, abs=0.2)
    assert steer.min() == pytest.approx(-60, abs=0.2)
    dwelling = np.count_nonzero(steer < -59.9) * 0.01
    assert dwelling == pytest.approx(0.5 + 0.02, abs=0.03)


def test_left_and_right_are_nearly_alike(driven: Any) -> None:
    """The centre of gravity lies 35 mm off the middle."""
    left, right = (
        driven(60, f"kind: sine_with_dwell, amplitude_deg: 60, direction: {side}")[0].manoeuvre
        for side in ("left", "right")
    )
    for name in ("yaw_rate_peak_deg_s", "lateral_displacement_m", "lateral_acceleration_max_m_s2"):
        assert left[name] == pytest.approx(right[name], rel=0.05)
        assert left[name] != right[name]


def test_step_steer_against_the_steady_state(driven: Any) -> None:
    """Gain of the single-track car: v / (L + K v^2) over the ratio; K from the driver's model."""
    found = driven(80, "kind: step_steer, amplitude_deg: 30")[0].manoeuvre
    v = 80 / 3.6
    gain = v / (2.675 + 0.0031 * v * v) / 16.5
    assert found["steering_wheel_deg"] == pytest.approx(30, abs=0.1)
    assert found["yaw_gain_per_s"] == pytest.approx(gain, rel=0.05)
    assert 0.05 < found["yaw_response_time_s"] < found["yaw_peak_time_s"] < 0.6
    assert found["yaw_response_time_s"] < found["lateral_acceleration_response_time_s"] < 0.6


@pytest.mark.parametrize("rate", [2, 4, 7])
def test_braking_holds_the_deceleration_to_a_stand(driven: Any, rate: float) -> None:
    result, recorder = driven(50, f"kind: brake, deceleration_m_s2: {rate}")
    found = result.manoeuvre
    assert found["mean_deceleration_m_s2"] == pytest.approx(rate, rel=0.03)
    assert found["distance_m"] == pytest.approx((50 / 3.6) ** 2 / (2 * rate), rel=0.08)
    assert found["path_deviation_m"] < 0.1
    assert abs(recorder.group("channels")[-1, 6]) < 0.01


def test_a_pedal_is_held_as_it_is(driven: Any) -> None:
    _, recorder = driven(60, "kind: brake, pedal: 0.3, to_kmh: 20")
    pedals = recorder.group("driver")[:, 1:]
    braking = pedals[:, 1] > 0.0
    assert set(pedals[braking, 1]) == {0.3}
    assert not pedals[braking, 0].any()
    assert recorder.group("channels")[-1, 6] == pytest.approx(20 / 3.6, abs=0.05)


def test_accelerating_holds_the_acceleration(driven: Any) -> None:
    found = driven(20, "kind: accelerate, acceleration_m_s2: 2, to_kmh: 60")[0].manoeuvre
    assert found["mean_acceleration_m_s2"] == pytest.approx(2.0, rel=0.03)
    assert found["time_s"] == pytest.approx((60 - 20) / 3.6 / 2, rel=0.05)


def test_braking_follows_a_road_that_bends(tmp_path: Path) -> None:
    manoeuvre = "kind: brake, deceleration_m_s2: 3, start_m: 175"  # in the rural road's first bend
    result, _ = drive(scenario(tmp_path, 40, manoeuvre, "{track: rural}"))
    assert result.finish_reason == "end of the manoeuvre"
    assert result.manoeuvre["path_deviation_m"] < 0.1
    assert result.manoeuvre["yaw_change_deg"] > 2.0


def test_the_driver_knows_a_slippery_road(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("name: snow\nroad: {track: rural, friction: 0.4}\ndriver: {style: normal}\n")
    result, recorder = drive(path, "duration=40")
    assert result.largest_deviation_m < 0.2
    ay = recorder.group("channels")[:, 1]
    assert np.abs(ay).max() < 0.4 * 8.2
    path = scenario(tmp_path, 35, "kind: slalom, spacing_m: 18")
    with pytest.raises(InputError, match=r"less than 4 m/s2 at a friction of 0\.4"):
        drive(path, "road.friction=0.4")


def test_grip_is_all_but_used_up_at_the_limit(driven: Any) -> None:
    """0.74 of the 0.84 g that the car can hold at all; a drive straight on hardly uses any."""
    fast, _ = driven(75, "kind: constant_radius", R60)
    slow, _ = driven(40, "kind: constant_speed", "{track: straight, length_m: 80}")
    peaks = [wheel["peak_percent"] for wheel in fast.grip.values()]
    assert len(peaks) == 4
    assert 70 < min(peaks) < max(peaks) < 115
    assert max(wheel["peak_percent"] for wheel in slow.grip.values()) < 15


def test_it_begins_where_it_is_told_to(tmp_path: Path) -> None:
    path = scenario(tmp_path, 50, "kind: brake, deceleration_m_s2: 5, start_m: 60")
    _, recorder = drive(path)
    begin = int(np.argmax(recorder.group("driver")[:, 2] > 0.0))
    assert recorder.group("vehicle")[begin, 0] == pytest.approx(60.0, abs=0.2)


def test_a_manoeuvre_may_be_cut_short(tmp_path: Path) -> None:
    path = scenario(tmp_path, 30, "kind: double_lane_change")
    result, recorder = drive(path, "duration=3")
    assert recorder.time[-1] == pytest.approx(3.0)
    assert result.finish_reason == "duration reached"
    assert result.manoeuvre == {}
    longer, _ = drive(path, "duration=12")
    assert longer.finish_reason == "end of the manoeuvre"


def test_a_wider_car_has_wider_gates_and_may_be_too_long_for_them(tmp_path: Path) -> None:
    path = scenario(tmp_path, 30, "kind: double_lane_change")
    outline = "vehicle.outline={width_m: 1.7, front_m: 2.3, rear_m: 2.0}"
    assert drive(path, outline)[0].manoeuvre["clearance_m"] > 0.0
    with pytest.raises(InputError, match="nothing leads a body of this shape through the gates"):
        drive(path, "vehicle.outline={width_m: 1.9, front_m: 9.5, rear_m: 9.5}")


def test_a_road_that_is_too_short_or_a_speed_that_is_too_high_is_told(tmp_path: Path) -> None:
    short = scenario(tmp_path, 60, "kind: brake, pedal: 0.5", "{track: straight, length_m: 40}")
    with pytest.raises(InputError, match=r"needs 9\d m of road; this one has 40 m"):
        drive(short)
    fast = scenario(tmp_path, 80, "kind: double_lane_change")
    with pytest.raises(InputError, match=r"at 80 km/h takes \d\d.\d m/s2 of lateral acceleration"):
        drive(fast)


def test_the_same_manoeuvre_twice_is_the_same_to_the_bit(tmp_path: Path) -> None:
    path = scenario(tmp_path, 40, "kind: double_lane_change")
    first, second = (drive(path)[1].group("vehicle") for _ in range(2))
    assert first.tobytes() == second.tobytes()
