import json
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from cosim.errors import InputError
from cosim.results import resolved_yaml
from cosim.scenario.load import load
from cosim.scenario.overrides import split_key
from cosim.scenario.paper_row import row_of
from cosim.scenario.schema import json_schema
from sensor.paper import paper_rows

SCENARIOS = Path(__file__).parents[1] / "scenarios"
FILES = sorted(path for path in SCENARIOS.rglob("*.yaml") if path.parent.name != "datasets")
GOOD = """\
name: a scenario
road:
  track: hockenheim
driver:
  style: normal
"""


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "good.yaml"
    path.write_text(GOOD)
    return path


def problems(tmp_path, text, overrides=()):
    """Return the messages for a scenario as (line, column, message)."""
    path = tmp_path / "scenario.yaml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load(path, overrides)
    return [
        (p.place.line if p.place else 0, p.place.column if p.place else 0, p.message)
        for p in caught.value.problems
    ]


def test_defaults(good):
    scenario = load(good)
    assert scenario.duration == "lap"
    assert scenario.road.surface.kind == "smooth"
    assert [controller.label for controller in scenario.controllers] == ["passive"]
    assert scenario.output.format == "csv"


def test_all_problems_at_once_each_at_its_place(tmp_path):
    found = problems(
        tmp_path,
        "name: x\n"
        "duration: -3\n"
        "road: {track: hockenhiem}\n"
        "driver:\n"
        "  sped_kmh: 50\n"
        "  speed_kmh: 0\n"
        "vehicle:\n"
        "  parameters: {Body.Mass: [fast]}\n"
        "sensor: {network: gone.onnx}\n"
        "controllers:\n"
        "  - kind: skyhok\n"
        "limits:\n"
        "  - {metric: sensor.overal.rmse_m_s, max: 1}\n",
    )
    assert [(line, column) for line, column, _ in found] == [
        (2, 11),
        (3, 15),
        (5, 3),
        (6, 14),
        (8, 27),
        (9, 19),
        (11, 5),
        (13, 14),
    ]
    messages = [message for *_, message in found]
    assert messages[0] == "duration must be 'lap' or a number of seconds greater than 0, not -3"
    assert messages[1].endswith("not 'hockenhiem'; did you mean 'hockenheim'?")
    assert messages[2] == "'sped_kmh' is not a field of driver; did you mean 'speed_kmh'?"
    assert messages[3] == "driver.speed_kmh must be at least 5 km/h, not 0 km/h"
    assert "must be one finite number" in messages[4]
    assert "there is no file" in messages[5]
    assert messages[6].endswith("not 'skyhok'; did you mean 'skyhook'?")
    assert messages[7].endswith("did you mean 'sensor.overall.rmse_m_s'?")


def test_a_field_in_the_wrong_section_is_sent_to_the_right_one(tmp_path):
    assert "it belongs to driver" in problems(tmp_path, GOOD + "speed_kmh: 50\n")[0][2]
    assert "it belongs to the top level" in problems(tmp_path, GOOD + "  seed: 3\n")[0][2]


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "is empty"),
        ("- a\n- b\n", "a mapping of fields to values belongs here"),
        ("name: [a\nroad: 1\n", "not YAML 1.2"),
        ("name: a\n\troad: 1\n", "not YAML 1.2"),
        ("name: a\n---\nname: b\n", "not YAML 1.2"),
        ("name: !!python/object:os.x {}\n", "not YAML 1.2"),
        ("name: &a [*a]\n", "inside its own anchor"),
        ("name: a\n", "the scenario has no road, which it needs"),
        ("name: a\nroad: {track: straight}\n", "needs its length_m"),
        ("name: a\nroad: {track: rural, length_m: 50}\n", "straight or the winding track only"),
        ("name: a\nroad: {track: rural, file: a.crg}\n", "either track or file"),
        ("name: a\nroad: {}\n", "either track or file"),
        ("name: a\nroad: {file: a.txt}\n", "an OpenCRG road (.crg)"),
        ("name: a\nroad: {track: rural, surface: {kind: iso8608}}\n", "has no class"),
        ("name: a\nroad: {track: rural, surface: {class: A}}\n", "has no kind"),
        ("name: a\nroad: {track: rural, surface: a}\n", "not 'a'; did you mean 'A'?"),
        ("name: a\nroad: {track: rural, surface: 3}\n", "road.surface must be smooth, A, B, C, D"),
        (
            "name: a\nroad: {track: rural, surface: {kind: cobbels}}\n",
            "kind must be cobbles, iso8608 or smooth, not 'cobbels'; did you mean 'cobbles'?",
        ),
        (
            "name: a\nroad: {track: rural, surface: {kind: bumps}}\n",
            "kind bumps lies on a surface: put it under road.obstacles",
        ),
        (
            "name: a\nroad: {track: rural, obstacles: [{kind: pothol}]}\n",
            "road.obstacles.0.kind must be bumps, hump or pothole, not 'pothol'; did you mean",
        ),
        (
            "name: a\nroad: {track: rural, obstacles: [{kind: hump, at_m: 1, height_m: 1}]}\n",
            "road.obstacles.0.at_m must be at least 3 m, not 1 m",
        ),
        ("name: a\nroad: {track: rural, friction: 0}\n", "road.friction must be at least 0.05"),
        (GOOD + "limits: [{metric: lap_time_s, max: 9, surface: E}]\n", "limits.0.surface must be"),
        (GOOD + "limits: [{metric: lap_time_s}]\n", "needs min, max or both"),
        (GOOD + "limits: [{metric: lap_time_s, min: 2, max: 1}]\n", "not be greater than max"),
        (GOOD + "controllers: []\n", "controllers must not be empty"),
        (GOOD + "controllers: [{kind: passive}, {kind: passive}]\n", "two runs are called"),
        (GOOD + "paper_row: Rural track, Normal diver\n", "'Rural track, Normal driver'"),
        (GOOD + "vehicle: {fmu: my.fmi}\n", "'builtin' or an FMU (.fmu)"),
        (GOOD + "vehicle: {parameters: {Body.Mass: [1]}}\n", "must be one finite number"),
        (GOOD + "seed: true\n", "seed must be a whole number, not true"),
        (GOOD + "seed: 1.5\n", "seed must be a whole number, not 1.5"),
        (GOOD + "  speed_kmh: .inf\n", "driver.speed_kmh must be"),
        (GOOD + "duration: .nan\n", "duration must be 'lap'"),
    ],
)
def test_bad_input_is_one_clear_sentence(tmp_path, text, part):
    found = problems(tmp_path, text)
    assert any(part in message for *_, message in found), found
    assert all("\n" not in message for *_, message in found)


def test_yaml_1_2(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        "name: no\nroad: {track: straight, length_m: 1e3}\ndriver: {speed_kmh: 1e1}\nseed: 010\n"
    )
    scenario = load(path)
    assert (scenario.name, scenario.road.length_m, scenario.driver.speed_kmh) == ("no", 1000, 10)
    assert scenario.seed == 10


@settings(deadline=None)
@given(st.integers(0, 3), st.integers(0, 3))
def test_a_doubled_key_is_reported_with_both_lines(tmp_path_factory, above, between):
    filler = [f"p{index}: {index}" for index in range(above + between)]
    lines = [*filler[:above], "Body.Mass: 1", *filler[above:], "Body.Mass: 2"]
    text = GOOD + "vehicle:\n  parameters:\n" + "".join(f"    {line}\n" for line in lines)
    found = problems(tmp_path_factory.mktemp("doubled"), text)
    first, second = 8 + above, 8 + len(lines) - 1
    assert found == [(second, 5, f"'Body.Mass' is already given in line {first}")]


@settings(deadline=None)
@given(st.text("abcdefghij", min_size=3, max_size=12), st.integers(0, 5), st.integers(1, 6))
def test_an_unknown_field_is_found_wherever_it_stands(tmp_path_factory, name, blank, indent):
    text = "name: x\nroad: {track: rural}\n" + "\n" * blank + "driver:\n" + " " * indent + name
    path = tmp_path_factory.mktemp("position")
    found = problems(path, text + "_z: 1\n")
    assert (4 + blank, indent + 1) in [(line, column) for line, column, _ in found]


@settings(deadline=None)
@given(st.floats(5, 200))
def test_set_is_the_same_as_writing_it_in_the_file(good, speed):
    path = good.with_name("written.yaml")
    path.write_text(GOOD + f"  speed_kmh: {speed!r}\n")
    assert load(good, [f"driver.speed_kmh={speed!r}"]).driver == load(path).driver


@settings(deadline=None)
@given(
    st.sampled_from(
        [
            "driver.style=fast",
            "seed=-1",
            "drver.style=normal",
            "seed",
            "=1",
            "controllers.3.kind=passive",
            "name.first=a",
            "seed=[",
            "road.x=1",
        ]
    )
)
def test_a_wrong_override_is_named_as_it_was_written(good, override):
    with pytest.raises(InputError) as caught:
        load(good, [override])
    assert all(str(p).startswith(f"--set {override}: ") for p in caught.value.problems)


def test_an_override_mends_what_the_file_has_wrong(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("name: x\nroad: {track: nowhere}\ndriver: {style: wild}\n")
    scenario = load(path, ["road={track: rural}", "driver.style=normal"])
    assert scenario.road.track == "rural"


@pytest.mark.parametrize(
    ("word", "name", "kind"),
    [
        ("smooth", "smooth", "smooth"),
        ("D", "D", "iso8608"),
        ("cobbles", "cobbles", "cobbles"),
        ("{kind: iso8608, class: A, seed: 3}", "A", "iso8608"),
        ("{kind: cobbles, class: B}", "cobbles", "cobbles"),
    ],
)
def test_a_surface_is_a_word_or_a_mapping(good, word, name, kind):
    surface = load(good, [f"road.surface={word}"]).road.surface
    assert (surface.name, surface.kind) == (name, kind)


def test_a_resolved_scenario_with_all_of_a_road_loads_again(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(
        "name: x\nroad:\n  track: rural\n  surface: B\n  friction: 0.4\n  obstacles:\n"
        "    - {kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 4, to_m: 60}\n"
        "    - {kind: hump, at_m: 80, height_m: 0.1, length_m: 4, side: left}\n"
        "    - {kind: pothole, at_m: 100, depth_m: 0.05, length_m: 0.6, width_m: 0.5}\n"
        "limits: [{metric: lap_time_s, max: 200, surface: B}]\n"
    )
    again = tmp_path / "again.yaml"
    again.write_text(resolved_yaml(load(path)))
    assert load(again).road == load(path).road
    assert load(again).limits == load(path).limits


def test_a_limit_of_a_surface_needs_a_surface(tmp_path):
    (tmp_path / "my.crg").touch()
    limits = "limits: [{metric: lap_time_s, max: 1, surface: A}]\n"
    found = problems(tmp_path, "name: x\nroad: {file: my.crg}\n" + limits)
    assert "a limit's surface belongs to a track" in found[0][2]
    found = problems(tmp_path, "name: x\nroad: {file: my.crg, obstacles: []}\n")
    assert "a road file has its own" in found[0][2]


def test_names_with_dots_stay_whole_below_the_vehicle(good):
    assert split_key("vehicle.parameters.Body.Mass") == ("vehicle", "parameters", "Body.Mass")
    assert split_key("vehicle.variables.Car.ax.name") == ("vehicle", "variables", "Car.ax", "name")
    assert split_key("controllers.0.kind") == ("controllers", 0, "kind")
    assert load(good, ["vehicle.parameters.Body.Mass=2500"]).vehicle.parameters == {
        "Body.Mass": 2500.0
    }


def test_later_checks_can_report_places(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text(GOOD + "vehicle:\n  parameters: {Body.Mas: 2500}\n")
    scenario = load(path)
    key = ("vehicle", "parameters", "Body.Mas")
    place = scenario.locate(key)
    assert (place.line, place.column) == (7, 26)
    assert place.source == "  parameters: {Body.Mas: 2500}"
    problem = scenario.problem(key, "no such parameter", ["Body.Mass", "Car.ax"])
    assert str(problem) == (
        f"{path}:7:16: no such parameter; did you mean 'Body.Mass'?\n"
        "     7 |   parameters: {Body.Mas: 2500}\n"
        "       |                ^^^^^^^^"
    )
    changed = load(path, ["vehicle.parameters.Body.Mas=1"]).locate(key)
    assert str(changed) == "--set vehicle.parameters.Body.Mas=1"


def test_paths_start_at_the_scenario_file(tmp_path):
    (tmp_path / "roads").mkdir()
    (tmp_path / "roads" / "my.crg").touch()
    path = tmp_path / "a.yaml"
    path.write_text("name: x\nroad: {file: roads/my.crg}\n")
    scenario = load(path)
    assert scenario.resolve(scenario.road.file) == tmp_path / "roads" / "my.crg"


def test_a_missing_file_names_its_neighbour(tmp_path):
    (tmp_path / "my.crg").touch()
    found = problems(tmp_path, "name: x\nroad: {file: mi.crg}\n")
    assert "did you mean 'my.crg'?" in found[0][2]


@pytest.mark.parametrize("name", ["gone.yaml", "folder", "latin.yaml"])
def test_files_that_cannot_be_read(tmp_path, name):
    (tmp_path / "folder").mkdir()
    (tmp_path / "latin.yaml").write_bytes(b"name: \xe9\n")
    with pytest.raises(InputError, match=r"no such scenario file|is a folder|is not UTF-8"):
        load(tmp_path / name)


def test_the_committed_json_schema_is_current():
    assert json.loads((SCENARIOS / "schema.json").read_text()) == json_schema()


def test_every_row_of_the_paper_has_its_scenario():
    scenarios = [load(path) for path in sorted((SCENARIOS / "paper").glob("*.yaml"))]
    assert sorted(row_of(scenario) for scenario in scenarios) == sorted(
        row.scenario for row in paper_rows()
    )
    for scenario in scenarios:
        assert scenario.road.surface_name == "smooth"
        regression = [x for x in scenario.limits if x.metric == "sensor.overall.rmse_m_s"]
        assert [limit.surface for limit in regression] == ["smooth", "A", "B"]
        assert len(scenario.limits) >= 5


@pytest.mark.parametrize(
    ("stem", "override", "still"),
    [
        ("hockenheim_normal", "road.surface=B", True),
        ("hockenheim_normal", "driver.style=defensive", False),
        ("hockenheim_normal", "driver.speed_kmh=80", False),
        ("hockenheim_normal", "road.track=rural", False),
        ("hockenheim_normal", "duration=10", False),
        ("constant_turn_r100_100_kmh", "road.direction=right", True),
        ("constant_turn_r100_100_kmh", "driver.speed_kmh=90", False),
        ("constant_turn_r100_100_kmh", "road.radius_m=120", False),
        ("sine_with_dwell_060_deg_080_kmh", "manoeuvre.amplitude_deg=80", False),
        ("slalom_18m_015_kmh", "manoeuvre.spacing_m=20", False),
        ("double_lane_change_030_kmh", "driver.speed_kmh=40", False),
        ("bumpy_road_025_kmh", "driver.speed_kmh=25", True),
        ("bumpy_road_025_kmh", "driver.speed_kmh=26", False),
    ],
)
def test_a_changed_scenario_is_no_longer_the_papers_row(stem, override, still):
    scenario = load(SCENARIOS / "paper" / f"{stem}.yaml", [override])
    assert (row_of(scenario) is not None) == still


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_every_scenario_loads_and_agrees_with_the_json_schema(path):
    load(path)
    first = path.read_text().splitlines()[0]
    prefix = "# yaml-language-server: $schema="
    assert first.startswith(prefix)
    schema = (path.parent / first.removeprefix(prefix)).resolve()
    assert schema == SCENARIOS / "schema.json"
    jsonschema.validate(YAML(typ="safe").load(path), json.loads(schema.read_text()))


@pytest.mark.parametrize("path", FILES[:3], ids=lambda path: path.stem)
def test_the_resolved_scenario_is_the_same_scenario(path, tmp_path):
    scenario = load(path, ["driver.speed_kmh=80"])
    copy = tmp_path / "copy.yaml"
    copy.write_text(resolved_yaml(scenario))
    assert load(copy).model_dump() == scenario.model_dump()
