"""A controller FMU in the loop: the built-in law's results, what it is told and when, mistakes."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import tracemalloc
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from control_rig import sample
from fmu_face import ROOT, build
from foreign_fmu import Variable, parrot
from hypothesis import given, settings
from hypothesis import strategies as st
from loop_rig import write_scenario

from cosim.assembly import assemble
from cosim.cli import main
from cosim.control.body import Body
from cosim.control.damper_map import DamperMap
from cosim.control.from_fmu import fmu_controller
from cosim.control.skyhook import Skyhook
from cosim.controller_fmu import FmuController
from cosim.errors import InputError
from cosim.quantities import CONTROLLER_INPUTS, DAMPERS
from cosim.run import execute
from cosim.scenario.controllers import ControllerFmu
from cosim.scenario.load import load

Array = npt.NDArray[np.float64]
BUMPS = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 5}"
COMMANDS = [q.name for q in DAMPERS]


@pytest.fixture(scope="session")
def controllers(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, int], Path]:
    """The example of docs/examples and the echo, by name and FMI version."""
    out = tmp_path_factory.mktemp("controllers")
    found = {}
    for model in (ROOT / "docs" / "examples" / "skyhook", ROOT / "tests" / "echo_controller"):
        paths = build.build(model, out)
        found |= {(model.name.partition("_")[0], v): p for v, p in zip((2, 3), paths, strict=True)}
    return found


@pytest.fixture
def skyhook(controllers: dict[tuple[str, int], Path], version: int) -> Path:
    return controllers["skyhook", version]


@pytest.fixture
def echo(controllers: dict[tuple[str, int], Path], version: int) -> Path:
    return controllers["echo", version]


def scenario(folder: Path, *own: str, duration: str = "2", **fields: str) -> Path:
    sections = {"controllers": f"[{', '.join(own)}]", **fields}
    return write_scenario(folder, duration=duration, obstacles=BUMPS, sections=sections)


def block(folder: Path, file: Path, more: str = "") -> FmuController:
    """The block of a scenario's controller FMU, connected."""
    loaded = load(scenario(folder, f"{{kind: fmu, file: {file}{more}}}"))
    (chosen,) = loaded.controllers
    assert isinstance(chosen, ControllerFmu)
    found = fmu_controller(loaded, chosen)
    found.connect()
    return found


def failure(path: Path, code: int) -> str:
    """What `cosim run` says of a scenario that fails with this exit code."""
    result = CliRunner().invoke(main, ["run", str(path), "--output-dir", str(path.parent / "o")])
    assert result.exit_code == code, result.output
    assert "Traceback" not in result.output
    return " ".join(result.stderr.split())


# ---------------------------------------------------------------- the built-in law as oracle


@pytest.mark.parametrize("feedback", ["truth", "estimate"])
def test_the_example_drives_like_the_built_in_skyhook(
    tmp_path: Path, skyhook: Path, feedback: str
) -> None:
    own = f"{{kind: skyhook, feedback: {feedback}, gain_ns_per_m: 3000}}"
    fmu = (
        f"{{kind: fmu, file: {skyhook}, feedback: {feedback}, parameters: {{Skyhook.Gain: 3000}}}}"
    )
    path = scenario(tmp_path, own, fmu, duration="3")
    wanted, found = (run.recorder for run in execute(load(path), tmp_path / "out").runs)
    assert wanted.group("command").std(axis=0).min() > 0.05  # the dampers were really switched
    for group in ("command", "truth", "channels"):
        np.testing.assert_allclose(found.group(group), wanted.group(group), rtol=0, atol=1e-9)


def test_with_latency_fallback_and_an_estimator_of_its_own(tmp_path: Path, skyhook: Path) -> None:
    more = (
        "estimator: kalman, latency: {sensor_ms: 10, damper_ms: 20}, "
        "fallback: {command: 0.4, back_after_s: 0.2, fade_s: 0.1}"
    )
    path = scenario(
        tmp_path, f"{{kind: skyhook, {more}}}", f"{{kind: fmu, file: {skyhook}, {more}}}"
    )
    wanted, found = (run.recorder for run in execute(load(path), tmp_path / "out").runs)
    np.testing.assert_allclose(found.group("command"), wanted.group("command"), rtol=0, atol=1e-9)
    assert found.group("command")[0].tolist() == [0.4] * 4
    assert found.group("command")[60:].std(axis=0).min() > 0.02


speed = st.floats(-3.0, 3.0)
corners = st.tuples(speed, speed, speed, speed)


def test_the_examples_law_is_the_built_in_one(tmp_path: Path, skyhook: Path) -> None:
    """Also beyond the damper's table, which no drive leaves."""
    made = block(tmp_path, skyhook, ", feedback: truth")
    law, body, wanted, zero = Skyhook(DamperMap()), Body(), np.zeros(4), np.zeros(4)
    rest = np.zeros(14)

    @settings(max_examples=200, deadline=None)
    @given(velocity=corners, heave=st.floats(-30.0, 30.0))
    def same(velocity: tuple[float, ...], heave: float) -> None:
        relative, rest[2] = np.array(velocity), heave
        body.step(rest)
        law(body, relative, zero, wanted)
        found = made.step(sample(rest, truth=relative))
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9)

    same()
    made.close()


# ---------------------------------------------------------------- what it is told, and when


@pytest.mark.parametrize(
    "index", range(30), ids=[q.name for q in CONTROLLER_INPUTS if not q.boolean]
)
def test_every_input_arrives_in_the_fmus_unit(
    tmp_path: Path, controllers: dict[tuple[str, int], Path], index: int
) -> None:
    made = block(tmp_path, controllers["echo", 3], f", parameters: {{Echo.Input: {index}}}")
    rng, body = np.random.default_rng(index), Body()
    for _ in range(5):
        measured, estimate, deviation = (rng.uniform(0.05, 0.1, n) for n in (14, 4, 4))
        found = made.step(sample(measured, estimate, True, deviation=deviation))
        body.step(measured)
    unit = np.ones(30)
    unit[7], unit[14:18] = np.degrees(1.0), 1000.0
    told = unit * np.concatenate([measured, estimate, deviation, body.velocity, body.acceleration])
    assert found[0] == pytest.approx(0.5 + 0.001 * told[index], abs=1e-12)
    made.close()


def test_the_fmus_clock_is_the_cars(tmp_path: Path, echo: Path) -> None:
    """At t_k it stands at t_k and knows the sample of t_k; at t_0 it was not stepped yet."""
    made = block(tmp_path, echo, ", feedback: truth, parameters: {Echo.Input: 14}")
    for k in range(200):
        found = made.step(sample(truth=np.full(4, 0.001 * k)))
        assert found.tolist() == pytest.approx([0.5 + 0.001 * k, k / 1e4, 1.0, k / 1e4], abs=1e-12)
    made.close()


def test_while_the_estimate_is_not_valid_it_decides_that_takes_the_flag(
    tmp_path: Path, echo: Path
) -> None:
    made = block(tmp_path, echo, ", parameters: {Echo.Input: 14}")
    nothing, some = sample(), sample(estimate=np.full(4, 0.02), valid=True)
    assert made.step(nothing)[[0, 2]].tolist() == [0.5, 0.0]
    assert made.step(some)[[0, 2]].tolist() == pytest.approx([0.52, 1.0])
    assert made.step(nothing)[[0, 2]].tolist() == pytest.approx([0.52, 0.0])  # the last velocity
    made.close()


def test_of_one_that_does_not_take_the_flag_the_last_command_stays(
    tmp_path: Path, skyhook: Path
) -> None:
    made = block(tmp_path, skyhook, ", initial_command: 0.7")
    heave = np.zeros(14)
    heave[2] = 30.0
    rest, moving = np.zeros(14), np.full(4, 0.1)
    assert made.command.tolist() == [0.7] * 4
    assert made.step(sample(rest)).tolist() == [0.7] * 4
    acting = made.step(sample(heave, moving, True)).copy()
    assert (acting > 0).all()
    assert made.step(sample(heave)).tolist() == acting.tolist()
    assert made.step(sample(heave, -moving, True)).tolist() == [0.0] * 4
    made.close()


@pytest.mark.parametrize("more", ["", ", feedback: truth"])
def test_a_deviation_that_nobody_expects_is_nought(tmp_path: Path, echo: Path, more: str) -> None:
    made = block(tmp_path, echo, f", parameters: {{Echo.Input: 18}}{more}")
    found = made.step(sample(estimate=np.zeros(4), valid=True))
    assert found[0] == 0.5
    made.close()


def test_a_step_allocates_nothing(tmp_path: Path, echo: Path) -> None:
    made = block(tmp_path, echo)
    known = sample(np.zeros(14), np.zeros(4), True, deviation=np.full(4, 0.01))
    tracemalloc.start()
    for _ in range(300):
        made.step(known)
    before = tracemalloc.get_traced_memory()[0]
    for _ in range(1000):
        made.step(known)
    now, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert now - before < 256
    assert peak - before < 2048
    made.close()


def test_runs_have_instances_of_their_own_and_leave_no_folder(
    tmp_path: Path, echo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its count of steps starts again in the second run."""
    folder = tmp_path / "unzipped"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    two = [f"{{kind: fmu, file: {echo}, name: {name}, feedback: truth}}" for name in "ab"]
    path = scenario(tmp_path, *two, duration="0.5")
    runs = execute(load(path), tmp_path / "out").runs
    for run in runs:
        counted = run.recorder.group("command")[:, 3]
        np.testing.assert_allclose(counted, np.arange(51) / 1e4, rtol=0, atol=1e-12)
    assert not list(folder.iterdir())
    versions = json.loads((tmp_path / "out" / "versions.json").read_text())
    assert versions["files"]["controller"]["path"] == str(echo)


def test_names_signs_and_units_by_the_map(tmp_path: Path, skyhook: Path, version: int) -> None:
    """Skyhook that is told compression from wheels that are swapped, both ways round."""
    swapped = {"FL": "FR", "FR": "FL", "RL": "RR", "RR": "RL"}
    lines = [f"VRel.{a}: {{name: VRel.{b}, scale: -1}}" for a, b in swapped.items()]
    made = block(tmp_path, skyhook, f", feedback: truth, variables: {{{', '.join(lines)}}}")
    plain = block(tmp_path, skyhook, ", feedback: truth")
    measured, truth = np.zeros(14), np.array([0.1, -0.1, 0.2, -0.3])
    made.step(sample(measured))
    plain.step(sample(measured))
    measured[2] = 30.0
    one = made.step(sample(measured, truth=truth)).copy()
    other = plain.step(sample(measured, truth=-truth[[1, 0, 3, 2]]))
    assert one.tolist() == other.tolist()
    assert 0 < np.count_nonzero(one) < 4
    made.close()
    plain.close()


def test_the_resolved_scenario_runs_again_and_inspect_names_the_file(
    tmp_path: Path, skyhook: Path
) -> None:
    shutil.copy(skyhook, tmp_path / "mine.fmu")
    path = scenario(tmp_path, "{kind: fmu, file: mine.fmu}", duration="0.2")
    execute(load(path), tmp_path / "out")
    again = load(tmp_path / "out" / "scenario.resolved.yaml")
    (chosen,) = again.controllers
    assert isinstance(chosen, ControllerFmu)
    assert again.resolve(chosen.file) == tmp_path / "mine.fmu"
    shown = CliRunner().invoke(main, ["inspect", str(path), "--json"])
    assert "controller fmu_estimate" in [f["what"] for f in json.loads(shown.output)["files"]]


# ---------------------------------------------------------------- an FMU of another tool

OTHER_TOOL = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Switching(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        kinds = {"extension": "input", "body": "input", "command": "output"}
        for name, kind in kinds.items():
            for corner in ("FL", "FR", "RL", "RR"):
                setattr(self, f"{name}_{corner}", 0.0)
                self.register_variable(
                    Real(f"{name}_{corner}", causality=getattr(Fmi2Causality, kind))
                )

    def exit_initialization_mode(self):
        self.do_step(0.0, 0.0)

    def do_step(self, time, step):
        for c in ("FL", "FR", "RL", "RR"):
            product = getattr(self, f"extension_{c}") * getattr(self, f"body_{c}")
            setattr(self, f"command_{c}", 0.3 if product > 0.0 else 0.0)
        return True
"""


def test_a_controller_from_pythonfmu(tmp_path: Path) -> None:
    builder = pytest.importorskip("pythonfmu.builder")
    script = tmp_path / "switching.py"
    script.write_text(OTHER_TOOL, encoding="utf-8")
    fmu = builder.FmuBuilder.build_FMU(script, dest=tmp_path)
    names = {"VRel.{}": "extension_{}", "VBody.{}": "body_{}"}
    names["Car.SuspControl.Damper{}.CtrlOut"] = "command_{}"
    lines = [
        f"{ours.format(c)}: {{name: {theirs.format(c)}}}"
        for ours, theirs in names.items()
        for c in ("FL", "FR", "RL", "RR")
    ]
    own = f"{{kind: fmu, file: {fmu}, feedback: truth, variables: {{{', '.join(lines)}}}}}"
    path = scenario(tmp_path, "{kind: skyhook_two_state, feedback: truth}", own)
    wanted, found = (run.recorder for run in execute(load(path), tmp_path / "out").runs)
    np.testing.assert_array_equal(found.group("command"), wanted.group("command"))
    assert set(np.unique(found.group("command"))) == {0.0, 0.3}


# ---------------------------------------------------------------- mistakes

INPUTS = [Variable(f"VRel.{c}", i, "input", "m/s") for i, c in enumerate(("FL", "FR", "RL", "RR"))]
ANSWERS = [
    Variable(f"Answer.{name}", 450 + i, "parameter", start=0.5) for i, name in enumerate(COMMANDS)
]
OUTPUTS = [Variable(name, 450 + i, "output", "1") for i, name in enumerate(COMMANDS)]
ORDERS = [
    Variable(f"Parrot.{name}", 400 + i, "parameter")
    for name, i in {"BadAt": 0, "BadOutput": 1, "BadValue": 2, "FailAt": 3, "FailStatus": 4,
                    "FailWords": 5, "SegfaultAt": 9}.items()
]  # fmt: skip


def bird(folder: Path, version: int, orders: Mapping[str, float], name: str = "p.fmu") -> str:
    """The entry of a parrot in the controller's place, which commands 0.5, with orders."""
    parrot(folder / name, [*INPUTS, *ANSWERS, *OUTPUTS, *ORDERS], version)
    shown = ", ".join(f"{key}: {value}" for key, value in orders.items())
    return f"{{kind: fmu, file: {name}, feedback: truth, parameters: {{{shown}}}}}"


@pytest.mark.parametrize("value", [1.5, -0.2])
def test_a_command_beyond_its_range_ends_the_run(
    tmp_path: Path, version: int, value: float
) -> None:
    own = bird(tmp_path, version, {f"Answer.{COMMANDS[2]}": value})
    said = failure(scenario(tmp_path, own), 3)
    assert f"p.fmu: {COMMANDS[2]} makes {COMMANDS[2]} {value:g} at t = 0 s" in said
    assert "0, soft, to 1, hard" in said
    assert "the last inputs were VRel.FL = " in said


def test_a_command_that_is_no_number_ends_the_run_and_keeps_what_was(
    tmp_path: Path, version: int
) -> None:
    own = bird(tmp_path, version, {"Parrot.BadAt": 30, "Parrot.BadOutput": 451})
    said = failure(scenario(tmp_path, own), 3)
    assert f"{COMMANDS[1]} nan at t = 0.3 s" in said
    rows = (tmp_path / "o" / "signals.csv").read_text().splitlines()
    assert len(rows) == 1 + 30


def test_rounding_beyond_the_range_is_none(tmp_path: Path, version: int) -> None:
    answers = zip(COMMANDS, (1 + 1e-12, -1e-12, 0.0, 1.0), strict=True)
    bird(tmp_path, version, {})
    lines = ", ".join(f"Answer.{name}: {value}" for name, value in answers)
    made = block(tmp_path, tmp_path / "p.fmu", f", feedback: truth, parameters: {{{lines}}}")
    assert made.step(sample()).tolist() == [1.0, 0.0, 0.0, 1.0]
    made.close()


@pytest.mark.parametrize("status", [2, 3, 4], ids=["discard", "error", "fatal"])
def test_a_step_that_fails_is_told_in_the_fmus_words(
    tmp_path: Path, version: int, status: int
) -> None:
    orders = {"Parrot.FailAt": 20, "Parrot.FailStatus": status, "Parrot.FailWords": 1}
    said = failure(scenario(tmp_path, bird(tmp_path, version, orders)), 3)
    assert "p.fmu: could not step at t = 0.19 s: the parrot fell off its perch" in said
    assert len((tmp_path / "o" / "signals.csv").read_text().splitlines()) == 1 + 20


def test_the_words_of_a_model_of_the_projects_own_build(tmp_path: Path, echo: Path) -> None:
    own = f"{{kind: fmu, file: {echo}, feedback: truth, parameters: {{Echo.FailAt: 0.3}}}}"
    assert "could not step at t = 0.3 s: it lost its voice" in failure(scenario(tmp_path, own), 3)


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_one_that_crashes_takes_no_other_run_with_it(tmp_path: Path) -> None:
    """In a batch each run has a process of its own; rows until then are kept."""
    crashing = bird(tmp_path, 3, {"Parrot.SegfaultAt": 40})
    (tmp_path / "s").mkdir()
    path = scenario(tmp_path, "{kind: passive}", crashing)
    shutil.move(path, tmp_path / "s" / "scenario.yaml")
    shutil.copy(tmp_path / "p.fmu", tmp_path / "s")
    result = CliRunner().invoke(
        main, ["run", str(tmp_path / "s"), "--jobs", "1", "--output-dir", str(tmp_path / "o")]
    )
    said = " ".join(result.output.split())
    assert result.exit_code == 3
    assert "fmu_truth" in said
    assert "SIGSEGV" in said
    results = tmp_path / "o" / "scenario"
    assert len((results / "fmu_truth" / "signals.csv").read_text().splitlines()) == 1 + 40
    assert len((results / "passive" / "signals.csv").read_text().splitlines()) == 1 + 201


def test_an_fmu_that_is_no_controller_is_told_with_its_variables(tmp_path: Path) -> None:
    outputs = [Variable(f"u_{c}", 450 + i, "output") for i, c in enumerate(("fl", "fr", "rl"))]
    parrot(tmp_path / "p.fmu", [Variable("v_fl", 0, "input"), *outputs])
    path = scenario(tmp_path, "{kind: passive}", "{kind: fmu, file: p.fmu}")
    said = failure(path, 2)
    assert f"'p.fmu' has no output {', '.join(COMMANDS[:3])} or {COMMANDS[3]}" in said
    assert "its outputs are u_fl, u_fr, u_rl" in said
    assert "'p.fmu' takes no suspension velocity, VRel.FL, VRel.FR, VRel.RL or VRel.RR" in said
    assert "its inputs are v_fl" in said
    assert f"{path}:" in said  # with its line


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ("variables: {VRel.FX: {name: VRel.FL}}", "unknown quantity 'VRel.FX'; did you mean"),
        ("variables: {VRel.FL: {name: VRel.Fl}}", "no variable 'VRel.Fl'; did you mean 'VRel.FL'?"),
        (f"variables: {{VRel.FL: {{name: {COMMANDS[0]}}}}}", "is output; VRel.FL needs input"),
        ("variables: {VRel.FL: {name: VBody.FL}}", "'VBody.FL' is mapped from both VRel.FL and"),
        ("variables: {ABody.FL: {name: VBody.FL}}", "which is no unit of ABody.FL [m/s2]"),
        ("variables: {Sensor.Valid: {name: VBody.FL}}", "Sensor.Valid needs true or false"),
        ("parameters: {Skyhook.Gian: 1}", "no parameter 'Skyhook.Gian'; did you mean"),
        ("parameters: {Skyhook.Gain: -1}", "Skyhook.Gain = -1 N.s/m is below its least value 0"),
        ("parameters: {VRel.FL: 1}", "'VRel.FL' is written by the loop at every step"),
        ("variables: {VRel.FL: {name: VRel.FL, scale: 0}}", "the scale of VRel.FL must not be 0"),
    ],
)
def test_a_mistake_in_the_settings(tmp_path: Path, skyhook: Path, more: str, said: str) -> None:
    path = scenario(tmp_path, "{kind: passive}", f"{{kind: fmu, file: {skyhook}, {more}}}")
    with pytest.raises(InputError) as caught:
        assemble(load(path), load(path).controllers[0])  # whichever controller comes first
    assert said in str(caught.value)
    (problem,) = caught.value.problems
    assert problem.place is not None
    assert problem.place.line == 5


def test_a_flag_has_neither_unit_nor_scale(tmp_path: Path, echo: Path) -> None:
    more = "variables: {Sensor.Valid: {name: Sensor.Valid, scale: -1}}"
    with pytest.raises(InputError, match="true or false; leave its unit and scale out"):
        block(tmp_path, echo, f", {more}")


def test_mistakes_that_the_scenario_alone_shows(tmp_path: Path, skyhook: Path) -> None:
    for own, said in {
        f"{{kind: fmu, fmu: {skyhook}}}": "the controller's FMU is named by file",
        "{kind: fmu}": "controllers.0 has no file, which it needs",
        "{kind: fmu, file: gone.fmu}": "controllers.0.file: there is no file",
        "{kind: fmu, file: gone.onnx}": "must be a controller FMU (.fmu), not 'gone.onnx'",
        f"{{kind: fmu, file: {skyhook}, feedback: truth, fallback: {{}}}}": "always valid",
    }.items():
        with pytest.raises(InputError) as caught:
            load(scenario(tmp_path, own))
        assert said in str(caught.value)


def test_a_file_that_is_no_fmu(tmp_path: Path) -> None:
    (tmp_path / "p.fmu").write_bytes(b"no zip")
    said = failure(scenario(tmp_path, "{kind: fmu, file: p.fmu}"), 3)
    assert "p.fmu: not a readable FMU" in said


def test_a_step_before_it_is_connected_is_a_defect(tmp_path: Path, skyhook: Path) -> None:
    loaded = load(scenario(tmp_path, f"{{kind: fmu, file: {skyhook}}}"))
    (chosen,) = loaded.controllers
    assert isinstance(chosen, ControllerFmu)
    made = fmu_controller(loaded, chosen)
    made.close()
    with pytest.raises(RuntimeError, match="connect"):
        made.step(sample())
