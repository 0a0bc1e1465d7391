"""The loop: what stands in row k, how late a command acts, what is left of a run that fails."""

from __future__ import annotations

import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from foreign_fmu import ECHO, Variable, own_variables, parrot
from loop_rig import WINDOW, Blind, Guess, write_scenario

from cosim.assembly import Assembly, assemble
from cosim.cli import main
from cosim.control.sample import Sample
from cosim.control.switching import SwitchingDampers
from cosim.errors import FmuError
from cosim.faults.latency import LateDampers
from cosim.loop import Blocks, ControllerBlock, MeasurementBlock, SensorBlock
from cosim.loop import run as run_loop
from cosim.realtime.clock import Clock
from cosim.recorder import Recorder, Signal, held
from cosim.run import execute
from cosim.scenario.load import load
from cosim.testbench import State
from sensor.carried.runtime import WARM_UP
from sensor.channels import PASSIVE_COMMAND

Array = npt.NDArray[np.float64]

BUMPS = "{kind: bumps, height_m: 0.02, length_m: 0.5, spacing_m: 5}"
CLOSED_LOOP = (
    "[{kind: passive}, {kind: skyhook, feedback: truth}, {kind: skyhook, feedback: estimate}]"
)


# ---------------------------------------------------------------- with blocks that only count


class Counter:
    """All four blocks in one: every value tells of which sample it is."""

    def __init__(self, last: int = 10_000, fails_at: int | None = None, error: float = 0.0) -> None:
        self.estimate: Array = np.full(4, np.nan)
        self.deviation: Array = np.full(4, np.nan)
        self.error = error  # of every measured channel
        self.last, self.fails_at = last, fails_at
        self.calls: list[str] = []
        self.held: list[tuple[float, float]] = []
        self.told: list[float] = []

    def blocks(self) -> Blocks:
        vehicle, driver = _CountingVehicle(self), _CountingDriver(self)
        return Blocks(vehicle, driver, self._measurement(), self._sensor(), self._damper())

    def _measurement(self) -> MeasurementBlock:
        counter = self

        class Measurement:
            def step(self, channels: Array, stage: Array) -> Array:
                counter.calls.append("measurement")
                assert stage[0] == channels[0]
                return channels + counter.error if counter.error else channels

        return Measurement()

    def _sensor(self) -> SensorBlock:
        counter = self

        class Sensor:
            estimate, deviation = counter.estimate, counter.deviation

            def step(self, measured: Array, command: Array) -> bool:
                counter.told.append(float(command[0]))
                counter.calls.append("sensor")
                if measured[0] == counter.fails_at:
                    raise FmuError("stop")
                self.estimate[:] = 100 + measured[0]
                self.deviation[:] = 500 + measured[0]
                return bool(measured[0] >= 2)

        return Sensor()

    def _damper(self) -> ControllerBlock:
        counter = self

        class Controller:
            command = np.full(4, 199.0)

            def step(self, sample: Sample) -> Array:
                counter.calls.append("controller")
                now = sample.measured[0]
                assert sample.estimate[0] == 100 + now
                assert sample.deviation[0] == 500 + now
                assert sample.truth[0] == counter.error - now
                assert sample.valid == (now >= 2)
                return np.full(4, 200 + now)

        return Controller()


class _CountingVehicle:
    def __init__(self, counter: Counter) -> None:
        self.counter, self.now = counter, 0.0

    def read(self) -> State:
        self.counter.calls.append("read")
        k = self.now
        return State(
            np.full(14, k), np.full(4, -k), np.full(3, k), np.full(14, 10 * k), np.full(11, k)
        )

    def write(self, driver_command: Array, damper_command: Array) -> None:
        self.counter.calls.append("write")
        self.counter.held.append((float(driver_command[0]), float(damper_command[0])))

    def step(self, k: int) -> None:
        self.counter.calls.append("step")
        assert k == self.now
        self.now += 1

    def connect(self) -> None:
        raise AssertionError("whoever connects it is not the loop")

    stop = connect


class _CountingDriver:
    def __init__(self, counter: Counter) -> None:
        self.counter, self.finished = counter, False

    def step(self, k: int, state: State) -> Array:
        self.counter.calls.append("driver")
        self.finished = k >= self.counter.last
        return np.full(3, 300.0 + k)


GROUPS = {
    "channels": 14, "estimate": 4, "deviation": 4, "valid": 1, "truth": 4, "command": 4,
    "driver": 3, "vehicle": 14, "ideal": 0,
    "measured": 0, "held": 0,
}  # fmt: skip


def recorder(rows: int, **other: int) -> Recorder:
    widths = {**GROUPS, **other}
    return Recorder(
        [(name, [Signal(f"{name}{i}", "") for i in range(n)]) for name, n in widths.items()], rows
    )


def test_row_k_is_everything_at_t_k() -> None:
    record = recorder(6)
    assert run_loop(Counter().blocks(), Clock(600), record, 5) == 5
    k = np.arange(6.0)
    expected = {
        "channels": k, "estimate": 100 + k, "deviation": 500 + k, "valid": (k >= 2), "truth": -k,
        "command": 200 + k, "driver": 300 + k, "vehicle": 10 * k,
    }  # fmt: skip
    for name, values in expected.items():
        for column in record.group(name).T:
            np.testing.assert_array_equal(column, values)
    np.testing.assert_array_equal(record.time, [i * 0.01 for i in range(6)])


def test_what_is_measured_goes_to_sensor_controller_and_record() -> None:
    record = recorder(6, ideal=14)
    run_loop(Counter(error=0.5).blocks(), Clock(600), record, 5)
    k = np.arange(6.0)
    np.testing.assert_array_equal(record.group("channels")[:, 13], k + 0.5)
    np.testing.assert_array_equal(record.group("estimate")[:, 0], 100.5 + k)
    np.testing.assert_array_equal(record.group("command")[:, 0], 200.5 + k)
    np.testing.assert_array_equal(record.group("ideal")[:, 13], k)
    np.testing.assert_array_equal(record.group("truth")[:, 0], -k)


class Shifted:
    """A fault that adds 0.25 to every channel; for the controller it is 0.125."""

    def __init__(self) -> None:
        self.bridged: Array = np.zeros(14)

    def step(self, k: int, measured: Array) -> Array:
        assert measured[0] == k + 0.5
        self.bridged = measured + 0.125
        return measured + 0.25


def test_a_fault_stands_between_measurement_and_sensor() -> None:
    """The sensor gets the faulty channels, the controller those without gaps; both are kept."""
    counter, record = Counter(error=0.5), recorder(6, ideal=14, measured=14)
    blocks = replace(counter.blocks(), faults=Shifted(), controller=Hearing())
    run_loop(blocks, Clock(600), record, 5)
    k = np.arange(6.0)
    np.testing.assert_array_equal(record.group("ideal")[:, 13], k)
    np.testing.assert_array_equal(record.group("measured")[:, 13], k + 0.5)
    np.testing.assert_array_equal(record.group("channels")[:, 13], k + 0.75)
    np.testing.assert_array_equal(record.group("estimate")[:, 0], 100.75 + k)
    np.testing.assert_array_equal(record.group("command")[:, 0], k + 0.625)


class Hearing:
    """A controller whose command is the channels that it gets."""

    def __init__(self) -> None:
        self.command: Array = np.full(4, 199.0)

    def step(self, sample: Sample) -> Array:
        return sample.measured[:4].copy()


def test_a_late_command_acts_samples_later_and_is_kept_beside_the_one_given() -> None:
    counter, record = Counter(), recorder(6, held=4)
    blocks = replace(counter.blocks(), dampers=LateDampers(2, np.full(4, 199.0)))
    run_loop(blocks, Clock(600), record, 5)
    held = [199.0, 199.0, 200.0, 201.0, 202.0, 203.0]
    np.testing.assert_array_equal(record.group("held")[:, 0], held)
    np.testing.assert_array_equal(record.group("command")[:, 0], 200 + np.arange(6.0))
    assert [damper for _, damper in counter.held] == held[:5]
    # the sensor's control unit knows what it sent, not what arrived
    assert counter.told == [199.0, *(200.0 + k for k in range(5))]


def test_commands_of_row_k_are_held_from_k_on() -> None:
    counter = Counter()
    run_loop(counter.blocks(), Clock(600), recorder(6), 5)
    assert counter.held == [(300.0 + k, 200.0 + k) for k in range(5)]


def test_the_sensor_is_told_the_command_that_was_held_until_now() -> None:
    counter, record = Counter(), recorder(6)
    run_loop(counter.blocks(), Clock(600), record, 5)
    assert counter.told == [199.0, *(200.0 + k for k in range(5))]
    before = held(record.group("command"), np.full(4, 199.0))
    np.testing.assert_array_equal(before[:, 0], counter.told)


def test_the_vehicle_is_read_told_and_stepped_once_a_sample() -> None:
    counter = Counter()
    run_loop(counter.blocks(), Clock(3), recorder(3), 2)
    assert [c for c in counter.calls if c in ("read", "write", "step")] == [
        *("read", "write", "step") * 2, "read",
    ]  # fmt: skip
    one = counter.calls[: counter.calls.index("step") + 1]
    assert one.index("sensor") < one.index("controller")
    assert one.index("measurement") < one.index("sensor")
    assert sorted(one) == [
        "controller", "driver", "measurement", "read", "sensor", "step", "write",
    ]  # fmt: skip


def test_the_last_row_is_that_in_which_the_driver_arrives() -> None:
    counter, record = Counter(last=3), recorder(100)
    assert run_loop(counter.blocks(), Clock(600), record, 99) == 3
    assert record.rows == 4
    assert len(counter.held) == 3


def test_a_clock_that_stops_ends_the_run_before_its_sample() -> None:
    class Stops(Clock):
        def wait(self, k: int) -> bool:
            return k < 4

    counter, record = Counter(), recorder(100)
    assert run_loop(counter.blocks(), Stops(100), record, 99) == 3
    assert record.rows == 4
    assert counter.calls.count("read") == 4


def test_rows_before_an_exception_stay() -> None:
    record = recorder(100)
    with pytest.raises(FmuError):
        run_loop(Counter(fails_at=7).blocks(), Clock(600), record, 99)
    assert record.rows == 7
    np.testing.assert_array_equal(record.group("channels")[:, 0], np.arange(7.0))


def test_progress_is_told_now_and_then() -> None:
    told: list[tuple[int, int]] = []
    run_loop(
        Counter().blocks(),
        Clock(600),
        recorder(501),
        500,
        lambda done, total: told.append((done, total)),
    )
    assert 2 < len(told) < 50
    assert all(total == 500 for _, total in told)
    assert [done for done, _ in told] == sorted({done for done, _ in told})


# ---------------------------------------------------------------- with an FMU


def parrot_scenario(folder: Path, orders: str = "", **sections: str) -> Path:
    """A parrot whose accelerations are what the steering wheel and the FL damper were last told."""
    echoes = (Variable("Echo.Steer", ECHO), Variable("Echo.FL", ECHO + 3))
    parrot(folder / "p.fmu", (*own_variables().values(), *echoes))
    mapping = "{Car.ax: {name: Echo.Steer}, Car.ay: {name: Echo.FL}}"
    vehicle = f"{{fmu: p.fmu, variables: {mapping}, parameters: {{{orders}}}}}"
    return write_scenario(folder, sections={"vehicle": vehicle, **sections})


def build(path: Path, sensor: SensorBlock, dampers: ControllerBlock | None = None) -> Assembly:
    scenario = load(path)
    return assemble(scenario, scenario.controllers[0], sensor, dampers)


def test_one_sample_of_delay(tmp_path: Path) -> None:
    built = build(parrot_scenario(tmp_path), Blind(), SwitchingDampers(1, 0.01))
    built.run(None)
    record = built.recorder
    steer, damper = record.group("driver")[:, 0], record.group("command")[:, 0]
    assert len(np.unique(damper)) > 1
    np.testing.assert_array_equal(record.group("channels")[1:, 0], steer[:-1])
    np.testing.assert_array_equal(record.group("channels")[1:, 1], damper[:-1])


def test_before_the_first_sample_the_dampers_have_the_initial_command(tmp_path: Path) -> None:
    controllers = "[{kind: skyhook, initial_command: 0.6}]"
    built = build(parrot_scenario(tmp_path, controllers=controllers), Guess())
    built.run(None)
    np.testing.assert_array_equal(built.recorder.group("channels")[:WINDOW, 1], 0.6)


@pytest.mark.parametrize(
    ("orders", "words", "rows"),
    [
        ("Parrot.FailAt: 30, Parrot.FailStatus: 3", "t = 0.29 s", 30),
        ("Parrot.BadAt: 30, Parrot.BadOutput: 105", "Car.YawRate is nan at t = 0.3 s", 30),
        ("Parrot.BadAt: 30, Parrot.BadOutput: 118", "Car.tx is nan at t = 0.3 s", 30),
    ],
    ids=["error", "nan among the channels", "nan in the pose"],
)
def test_an_fmu_that_fails_leaves_its_rows_and_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, orders: str, words: str, rows: int
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    path = parrot_scenario(tmp_path, orders)
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    built = build(path, Blind())
    with pytest.raises(FmuError) as caught:
        built.run(None)
    assert words in str(caught.value)
    assert built.recorder.rows == rows
    assert np.isfinite(built.recorder.group("channels")).all()
    assert not list(scratch.iterdir())


def test_what_was_recorded_before_a_failure_is_written(tmp_path: Path) -> None:
    path = parrot_scenario(tmp_path, "Parrot.FailAt: 30, Parrot.FailStatus: 3")
    with pytest.raises(FmuError):
        execute(load(path), tmp_path / "out", assemble=guessing)
    assert len((tmp_path / "out" / "signals.csv").read_text().splitlines()) == 31


def test_a_run_that_is_interrupted_frees_the_fmu(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    path = parrot_scenario(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(scratch))
    built = build(path, Blind())

    def interrupt(done: int, total: int) -> None:
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        built.run(interrupt)
    assert built.recorder.rows > 1
    assert not list(scratch.iterdir())


# ---------------------------------------------------------------- estimates and figures


def guessing(scenario: Any, controller: Any) -> Assembly:
    return assemble(scenario, controller, sensor=Guess())


def figures(folder: Path) -> dict[str, Any]:
    """metrics.json without what the clock on the wall decides."""
    metrics: dict[str, Any] = json.loads((folder / "metrics.json").read_text())
    for run in metrics["runs"].values():
        del run["wall_time_s"], run["real_time_factor"], run["timing"]
    return metrics


def test_estimates_count_from_the_first_full_window_on(tmp_path: Path) -> None:
    outcome = execute(
        load(write_scenario(tmp_path, obstacles=BUMPS)), tmp_path / "out", None, guessing
    )
    record = outcome.runs[0].recorder
    estimate, truth = record.group("estimate"), record.group("truth")
    first = WINDOW - 1
    assert np.isnan(estimate[:first]).all()
    assert np.isfinite(estimate[first:]).all()
    np.testing.assert_array_equal(record.group("valid")[:, 0], np.arange(record.rows) >= first)
    found = outcome.runs[0].figures
    assert found["valid_samples"] == record.rows - first
    errors = (estimate - truth)[first:]
    assert found["sensor"]["overall"]["rmse_m_s"] == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert found["sensor"]["RL"]["rmse_m_s"] == pytest.approx(np.sqrt(np.mean(errors[:, 2] ** 2)))
    header, *rows = (tmp_path / "out" / "signals.csv").read_text().splitlines()
    column = header.split(",").index("VRel.FL [m/s]")
    written = [row.split(",")[column] for row in rows]
    assert written[:first] == ["nan"] * first
    assert "nan" not in written[first:]


def test_a_sensor_that_is_never_valid_has_no_figures(tmp_path: Path) -> None:
    scenario = load(write_scenario(tmp_path, duration="0.1"))
    outcome = execute(scenario, tmp_path / "out", None, guessing)
    found = outcome.runs[0].figures
    assert found["valid_samples"] == 0
    assert "sensor" not in found


# ---------------------------------------------------------------- the same scenario, the same bytes


@pytest.fixture(scope="module")
def closed_loop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three controllers on a random road; `results` below the scenario's folder."""
    folder = tmp_path_factory.mktemp("closed_loop")
    path = write_scenario(
        folder,
        duration="2.5",
        surface="{kind: iso8608, class: C}",
        sections={"controllers": CLOSED_LOOP, "seed": "7"},
    )
    execute(load(path), folder / "results", None, guessing)
    return path


LABELS = ("passive", "skyhook_truth", "skyhook_estimate")


def test_the_same_scenario_gives_the_same_bytes(
    closed_loop: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the road made once more, too."""
    monkeypatch.setenv("COSIM_CACHE_DIR", str(tmp_path / "roads"))
    execute(load(closed_loop), tmp_path / "again", None, guessing)
    first = closed_loop.parent / "results"
    for label in LABELS:
        signals = [(f / label / "signals.csv").read_bytes() for f in (first, tmp_path / "again")]
        assert signals[0] == signals[1]
    assert figures(first) == figures(tmp_path / "again")
    assert len(list((tmp_path / "roads").iterdir())) == 1


def test_a_controller_alone_does_what_it_does_among_others(
    closed_loop: Path, tmp_path: Path
) -> None:
    alone = load(closed_loop, ["controllers=[{kind: skyhook, feedback: truth}]"])
    execute(alone, tmp_path, None, guessing)
    among = closed_loop.parent / "results" / "skyhook_truth" / "signals.csv"
    assert (tmp_path / "signals.csv").read_bytes() == among.read_bytes()


def test_another_seed_is_another_road(closed_loop: Path, tmp_path: Path) -> None:
    other = load(closed_loop, ["seed=8", "controllers=[{kind: passive}]"])
    execute(other, tmp_path, None, guessing)
    first = closed_loop.parent / "results" / "passive" / "signals.csv"
    assert (tmp_path / "signals.csv").read_bytes() != first.read_bytes()


def test_both_standards_drive_the_same_lap(closed_loop: Path, tmp_path: Path) -> None:
    other = load(closed_loop, ["vehicle.fmi_version=2", "controllers=[{kind: passive}]"])
    execute(other, tmp_path, None, guessing)
    first = closed_loop.parent / "results" / "passive" / "signals.csv"
    assert (tmp_path / "signals.csv").read_bytes() == first.read_bytes()


def test_controllers_differ_only_from_when_they_may_act(closed_loop: Path) -> None:
    """All begin on the same road at the same speed; skyhook on the truth acts from the start."""
    results = closed_loop.parent / "results"
    tables = {
        label: np.genfromtxt(results / label / "signals.csv", delimiter=",", skip_header=1)
        for label in LABELS
    }
    head = (results / "passive" / "signals.csv").read_text().splitlines()[0].split(",")
    rear = head.index("Car.SuspControl.DamperRL.CtrlOut")
    assert (tables["passive"][:, rear] == PASSIVE_COMMAND).all()
    assert (tables["skyhook_estimate"][: WINDOW - 1, rear] == 0).all()
    for label in LABELS[1:]:
        command = tables[label][:, rear]
        assert command.min() >= 0.0
        assert command.max() > 0.5
        assert not np.array_equal(tables[label], tables["passive"])


def test_telling_progress_changes_nothing(tmp_path: Path) -> None:
    told = []
    path = write_scenario(tmp_path, obstacles=BUMPS)
    first, second = build(path, Guess()), build(path, Guess())
    first.run(None)
    second.run(lambda done, total: told.append(done))
    assert told
    runs = [a.recorder.write(tmp_path / n).read_bytes() for a, n in ((first, "a"), (second, "b"))]
    assert runs[0] == runs[1]


# ---------------------------------------------------------------- from the command line


def test_an_fmu_that_fails_ends_the_command_with_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = parrot_scenario(tmp_path, "Parrot.BadAt: 40, Parrot.BadOutput: 106")
    monkeypatch.setattr("cosim.assembly.estimator_of", lambda *_: Guess())
    out = tmp_path / "out"
    result = CliRunner().invoke(main, ["run", str(path), "--output-dir", str(out)])
    assert result.exit_code == 3
    assert result.stderr.startswith("error: p.fmu: Car.vx is nan at t = 0.4 s; the last inputs")
    assert "Traceback" not in result.output
    assert len((out / "signals.csv").read_text().splitlines()) == 41


def test_the_shipped_network_estimates_in_the_loop(tmp_path: Path) -> None:
    """On a road like those that it was trained on, it beats standing still."""
    path = tmp_path / "lap.yaml"
    surface = "{kind: iso8608, class: A}"
    path.write_text(f"name: a\nduration: 15\nroad: {{track: hockenheim, surface: {surface}}}\n")
    out = tmp_path / "out"
    result = CliRunner().invoke(main, ["run", str(path), "--json", "--output-dir", str(out)])
    assert result.exit_code == 0, result.stderr
    run = json.loads(result.stdout)["runs"]["passive"]
    assert run["valid_samples"] == 1501 - WARM_UP
    assert run["sensor"]["overall"]["rmse_m_s"] < 0.3 * run["zero"]["overall"]["rmse_m_s"]
    assert json.loads((out / "versions.json").read_text())["files"].keys() >= {
        "scenario", "fmu", "sensor", "road",
    }  # fmt: skip
