"""Parts of a scenario that do not go together, each told in one sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.errors import InputError
from cosim.scenario.load import load

STRAIGHT, CIRCLE = "{track: straight}", "{track: circle, radius_m: 30}"
STEP = "{kind: step_steer, amplitude_deg: 30}"
SLALOM = "{kind: slalom, spacing_m: 18}"


def complaints(folder: Path, road: str, manoeuvre: str, driver: str) -> list[str]:
    path = folder / "scenario.yaml"
    path.write_text(f"name: x\nroad: {road}\nmanoeuvre: {manoeuvre}\ndriver: {driver}\n")
    with pytest.raises(InputError) as caught:
        load(path)
    return [str(problem) for problem in caught.value.problems]


@pytest.mark.parametrize(
    ("road", "manoeuvre", "driver", "sentence"),
    [
        (CIRCLE, SLALOM, "{speed_kmh: 20}", "3:19: the slalom needs the straight track, not the c"),
        (STRAIGHT, "{kind: constant_radius}", "{speed_kmh: 20}", "at constant radius needs the ci"),
        ("{track: rural}", STEP, "{speed_kmh: 50}", "straight track, not the rural track"),
        (STRAIGHT, STEP, "{style: normal}", "3:12: the step steer needs driver.speed_kmh"),
        (STRAIGHT, STEP, "{speed_kmh: 10}", "4:21: the step steer needs at least 15 km/h, not 10"),
        (CIRCLE, "{kind: constant_radius}", "{speed_kmh: 70}", "at 70 km/h takes 12.6 m/s2"),
        (STRAIGHT, SLALOM, "{speed_kmh: 60}", "the slalom at 60 km/h takes 13.5 m/s2"),
        (
            STRAIGHT,
            "{kind: sine_with_dwell, amplitude_deg: 500}",
            "{speed_kmh: 50}",
            "manoeuvre.amplitude_deg must be at most 300 deg, not 500 deg",
        ),
        (STRAIGHT, "{kind: slalon}", "{speed_kmh: 20}", "not 'slalon'; did you mean 'slalom'?"),
        (STRAIGHT, "slalom", "{speed_kmh: 20}", "manoeuvre must be a mapping with kind: "),
        (STRAIGHT, "{kind: slalom}", "{speed_kmh: 20}", "manoeuvre has no spacing_m, which it nee"),
        (STRAIGHT, "{kind: brake}", "{speed_kmh: 20}", "give either deceleration_m_s2 or pedal"),
        (
            STRAIGHT,
            "{kind: brake, pedal: 0.3, to_kmh: 50}",
            "{speed_kmh: 50}",
            "braking to 50 km/h must begin faster than that, not at 50 km/h",
        ),
        (
            STRAIGHT,
            "{kind: accelerate, pedal: 0.3, to_kmh: 50}",
            "{speed_kmh: 60}",
            "accelerating to 50 km/h must begin slower than that, not at 60 km/h",
        ),
        (STRAIGHT, "{kind: constant_speed}", "{speed_kmh: 20}", "the straight track needs its len"),
        ("{track: circle}", STEP, "{speed_kmh: 20}", "the circle needs its radius_m"),
        ("{track: rural, radius_m: 5}", STEP, "{speed_kmh: 20}", "radius_m must be at least 10 m"),
        ("{track: rural, radius_m: 50}", STEP, "{speed_kmh: 20}", "belongs to the circle track on"),
        ("{track: circle, radius_m: 50, direction: lft}", STEP, "{speed_kmh: 20}", "mean 'left'?"),
    ],
)
def test_what_does_not_go_together_is_one_sentence(
    tmp_path: Path, road: str, manoeuvre: str, driver: str, sentence: str
) -> None:
    (complaint,) = complaints(tmp_path, road, manoeuvre, driver)
    assert sentence in complaint


def test_a_limit_may_name_only_the_figures_of_its_manoeuvre(tmp_path: Path) -> None:
    path = tmp_path / "scenario.yaml"
    text = f"name: x\nroad: {STRAIGHT}\nmanoeuvre: {SLALOM}\ndriver: {{speed_kmh: 20}}\n"
    path.write_text(text + "limits: [{metric: manoeuvre.clearance_m, min: 0.1}]\n")
    assert load(path).limits[0].metric == "manoeuvre.clearance_m"
    path.write_text(text + "limits: [{metric: manoeuvre.side_slip_deg, max: 1}]\n")
    other = r"is a figure of the manoeuvre constant_radius, not of slalom"
    with pytest.raises(InputError, match=other):
        load(path)
    with pytest.raises(InputError, match="and this scenario has none"):
        load(path, ["manoeuvre=", "road.length_m=100"])
    with pytest.raises(InputError, match=r"did you mean 'manoeuvre.clearance_m'"):
        load(path, ["limits.0.metric=manoeuvre.clearence_m"])
