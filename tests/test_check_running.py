"""`cosim check` on FMUs that run: mutants of the fixture's C code, one defect each."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from fmu_face import ROOT, build, package
from fmu_mutants import MODEL, Edit, entry, mutate, put, version_of
from fmu_rebuild import NEEDS_BINUTILS, Functions, rebuilt

from cosim.check import dynamic
from cosim.check.checker import check
from cosim.check.finding import Report
from cosim.check.trials.bench import swing
from cosim.check.trials.job import Channel, Job
from cosim.check.trials.rules import other_value
from cosim.isolation import Children, Death, Watch, WorkError

pytestmark = NEEDS_BINUTILS


class Shared(Children):
    """One server of forks for many checks, which is quicker than one for each."""

    def __exit__(self, *_: object) -> None:
        """Stay."""

    def again(self, modules: tuple[str, ...]) -> Shared:
        return self


@pytest.fixture(scope="module")
def shared() -> Iterator[Shared]:
    children = Shared(dynamic.MODULES)
    yield children
    Children.__exit__(children)


@pytest.fixture(autouse=True)
def _quick(shared: Shared, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dynamic, "Children", shared.again)


@pytest.fixture
def mutant(fmus: dict[int, Path], version: int, tmp_path: Path) -> Callable[..., Report]:
    """Checks the fixture with other bodies of some functions."""

    def make(functions: Functions, timeout: float = 20.0, **others: object) -> Report:
        return check(rebuilt(fmus[version], tmp_path, functions, **others), timeout=timeout)

    return make


def alone(report: Report, code: str, *words: str) -> None:
    """Assert that this code and no other was found, with all words in one of its messages."""
    assert report.codes == [code], [(f.code, f.message) for f in report.findings]
    said = [f"{f.where} {f.message}" for f in report.findings]
    assert any(all(word in text for word in words) for text in said), said


def test_the_fixture_is_sound(mutant: Callable[..., Report]) -> None:
    report = mutant({})
    assert report.findings == []
    assert report.not_judged == []
    assert report.trials == [t for t in dynamic.TRIALS if t in report.trials]
    assert len(report.trials) == len(dynamic.TRIALS)


def test_the_vehicle_is_sound_but_for_its_flat_road(version: int) -> None:
    path = ROOT / "cosim" / "fmus" / f"vehicle.fmi{version}.fmu"
    if not path.is_file():
        pytest.skip("the vehicle FMUs are not built")
    report = check(path)
    assert report.count("error") == 0, [(f.code, f.message) for f in report.findings]
    assert set(report.codes) <= {"outputs-constant"}
    assert report.not_judged == []


# ---------------------------------------------------------------- mutants

LATE = "if (t > 0.95)"
NOT_TODAY = {"GetState": 'REFUSE("not today")'}
FIXED_STEP = {"DoStep": 'if (fabs(h - 0.1) > 1e-9) REFUSE("fixed step") return INNER;'}
SHARED_GAIN = {
    "top": "static double gain = 1;",
    "Experiment": "gain = 1; return INNER;",
    "SetReal": "if (vr[0] == VR(Lag.Gain)) gain = v[0]; return INNER;",
    "GetReal": "Status s = INNER; for (size_t k = 0; k < n; k++) if (vr[k] == VR(Out.FL)) "
    "v[k] *= gain; return s;",
}
CRASH = {"DoStep": f"{LATE} *(volatile int *)0 = 1; return INNER;"}
ABORT = {"DoStep": f"{LATE} abort(); return INNER;"}
HANG = {"DoStep": f"{LATE} for (;;) {{}} return INNER;"}


def reading(variable: str, value: str) -> Functions:
    """A getter that answers another value for one variable, of the true value x."""
    return {
        "GetReal": f"Status s = INNER; for (size_t k = 0; k < n; k++) if (vr[k] == VR({variable})) "
        f"{{ double x = v[k]; v[k] = {value}; }} return s;"
    }


def changed_gain(function: str) -> Functions:
    """A function that leaves another gain behind."""
    return {function: "Status s = INNER; set(c, VR(Lag.Gain), 2.0); return s;"}


MUTANTS: list[tuple[str, Functions, list[str]]] = [
    ("output-not-finite", reading("Out.FR", "get(c, VR(Out.FL)) > 0.87 ? NAN : x"),
     ["Out.FR is nan", "t = 1.1 s"]),
    ("output-not-finite", reading("Out.RL", "INFINITY"), ["Out.RL is inf", "t = 0 s"]),
    ("step-failed", {"DoStep": f'{LATE} REFUSE("the wheel came off") return INNER;'},
     ["t = 1 s", "answered Error: the wheel came off"]),
    ("initialise-failed", {"ExitInitializationMode": 'REFUSE("no static start")'},
     ["ExitInitializationMode", "no static start"]),
    ("inputs-refused",
     {"DoStep": 'if (get(c, VR(In.u)) != 1.0) REFUSE("only 1 rad") return INNER;'},
     ["move", "only 1 rad"]),
    ("call-failed", {"top": "static int lives;",
     "Experiment": 'if (++lives > 150) REFUSE("too old") return INNER;'}, ["too old"]),
    ("outputs-constant", reading("Out.RR", "0.5"), ["1 of 4 continuous", "Out.RR"]),
    ("not-deterministic", {"top": "static double noise(void) { struct timespec now; "
     "timespec_get(&now, 1); return 1e-12 * now.tv_nsec; }", **reading("Out.FL", "x + noise()")},
     ["Out.FL", "two runs"]),
    ("step-size-refused", FIXED_STEP, ["0.05 s", "0.1 s is the default", "fixed step"]),
    ("thread-bound", {"top": "static _Thread_local int here; static int *home;",
     "ExitInitializationMode": "home = &here; return INNER;",
     "DoStep": 'if (home != &here) REFUSE("wrong thread") return INNER;'},
     ["another thread", "wrong thread"]),
    ("path-sensitive", {"Instantiate": 'if (strstr(resources, "%20") || strchr(resources, 32)) '
     '{ SAY(NULL, "a space"); return NULL; } return INNER;'}, ["Prüfstand", "a space"]),
    ("cannot-load", {"top": "extern int nowhere; int *use = &nowhere;"},
     ["undefined symbol: nowhere"]),
    ("instances-share", SHARED_GAIN, ["static variables", "Out.FL"]),
    ("instances-share", {"top": "static int alive;",
     "Instantiate": "if (alive) return NULL; void *c = INNER; alive = c != NULL; return c;",
     "FreeInstance": "alive = 0; INNER;"}, ["second instance is refused"]),
    ("state-not-restored", {"SetState": "return OK;"}, ["SetFMU", "right after"]),
    ("state-not-restored", changed_gain("SetState"), ["replay", "Out.", "instead of"]),
    ("state-not-restored", {"top": "static int broken;", "SetState": "broken = 1; return INNER;",
     "DoStep": 'if (broken) REFUSE("time went back") return INNER;'},
     ["saved time are refused", "time went back"]),
    ("state-call-failed", NOT_TODAY, ["GetFMU", "not today"]),
    ("serialise-failed", {"StateSize": 'REFUSE("not today")'}, ["SerializedFMU", "not today"]),
    ("serialised-state-differs", {"top": "static int damaged;",
     "Deserialize": "damaged = 1; return INNER;", "SetState": "Status s = INNER; "
     "if (damaged) set(c, VR(Lag.Gain), 2.0); return s;"}, ["Out.", "bytes"]),
    ("reset-incomplete", {"Reset": "return OK;"}, ["Reset", "not as it was after instantiation"]),
    ("reset-incomplete", changed_gain("Reset"), ["Reset", "Out.", "instead of"]),
    ("reset-incomplete", {"Reset": 'REFUSE("not today")'}, ["Reset answered Error", "not today"]),
    ("token-not-checked", {"Instantiate": "token = TOKEN; return INNER;"}, ["wrong", "{00000000"]),
    ("wrong-order-accepted", {"DoStep": "Status s = INNER; return t == 0 ? OK : s;"},
     ["DoStep before initialisation answers OK"]),
    ("wrong-order-accepted", {"ExitInitializationMode": "Status s = INNER; return OK;"},
     ["ExitInitializationMode without EnterInitializationMode"]),
    ("stop-time-ignored", {"Experiment": "limited = 0; return INNER;"},
     ["past the stop time 0.2 s"]),
    ("terminate-failed", {"Terminate": 'REFUSE("not now")'}, ["Terminate", "not now"]),
    ("value-not-kept", {"SetReal": "if (vr[0] == VR(Lag.Start)) return OK; return INNER;"},
     ["Lag.Start", "reads back 0.0"]),
    ("set-refused", {"SetReal": 'if (vr[0] == VR(Lag.Pressure) && v[0] > 1) REFUSE("too high") '
     "return INNER;"}, ["Lag.Pressure", "too high"]),
    ("start-differs", reading("Lag.Gain", "x == 1 ? 2 : x"),
     ["Lag.Gain starts at 2.0 in the binary, but at 1.0 in the XML"]),
    ("memory-growth", {"FreeInstance": ""}, ["KiB each"]),
    ("version-mismatch", {"GetVersion": 'return "1.0";'}, ["GetVersion answers '1.0'"]),
    ("crash", CRASH, ["SIGSEGV", "DoStep at t = 1 s", "with its default inputs"]),
    ("crash", {"DoStep": f'{LATE} {{ fprintf(stderr, "assertion: x > 0\\n"); abort(); }} '
     "return INNER;"}, ["SIGABRT", "it printed: assertion: x > 0"]),
    ("crash", {"Reset": "abort();"}, ["SIGABRT", "Reset", "while it is reset"]),
    ("crash", {"FreeInstance": "abort();"}, ["FreeInstance"]),
    ("process-ended", {"DoStep": f"{LATE} exit(3); return INNER;"},
     ["ended the whole process", "DoStep at t = 1 s"]),
]  # fmt: skip
TIMES: list[tuple[str, Functions, list[str]]] = [  # which FMI 2.0 does not tell
    ("time-wrong", reading("time", "0"), ["time is 0 s after the step to t = 0.1 s"]),
    ("time-wrong", {"DoStep": "Status s = INNER; *last = 7; return s;"},
     ["lastSuccessfulTime is 7 s"]),
]  # fmt: skip


def cases() -> list[object]:
    """Each defect in both versions; what breaks in a further way is tried in one of them."""
    made, known = [], set()
    for i, (code, functions, words) in enumerate(MUTANTS):
        for version in (2 + i % 2,) if code in known else (2, 3):
            values = (version, code, functions, words)
            made.append(pytest.param(*values, id=f"fmi{version}-{code}{i}"))
        known.add(code)
    return made


@pytest.mark.parametrize(("version", "code", "functions", "words"), cases())
def test_a_defect_that_shows_in_running_is_named(
    mutant: Callable[..., Report], code: str, functions: Functions, words: list[str]
) -> None:
    alone(mutant(functions), code, *words)


@pytest.mark.parametrize(("code", "functions", "words"), TIMES)
def test_a_wrong_time_is_named(
    fmus: dict[int, Path], tmp_path: Path, code: str, functions: Functions, words: list[str]
) -> None:
    alone(check(rebuilt(fmus[3], tmp_path, functions)), code, *words)


def test_a_call_that_does_not_return(mutant: Callable[..., Report]) -> None:
    begin = time.perf_counter()
    report = mutant(HANG, timeout=0.3)
    alone(report, "hang", "DoStep at t = 1 s", "did not return within 0.3 s", "default inputs")
    assert report.not_judged == ["everything that needs it to run with its defaults"]
    assert time.perf_counter() - begin < 10.0


def test_a_hang_in_one_trial_leaves_the_others(mutant: Callable[..., Report]) -> None:
    report = mutant({"Reset": "for (;;) {}"}, timeout=0.3)
    alone(report, "hang", "Reset", "while it is reset")
    assert len(report.trials) == len(dynamic.TRIALS) - 1


# ---------------------------------------------------------------- XML against binary


def put_token(root: object) -> None:
    name = "guid" if version_of(root) == 2 else "instantiationToken"
    root.set(name, "{11111111-2222-3333-4444-555555555555}")


def forget_categories(root: object) -> None:
    entry(root, "LogCategories").remove(entry(root, "LogCategories")[0])


def one_instance(root: object) -> None:
    entry(root, "CoSimulation").set("canBeInstantiatedOnlyOncePerProcess", "true")


def no_flags(root: object) -> None:
    simulation = entry(root, "CoSimulation")
    for name in list(simulation.attrib):
        if name.startswith("can"):
            del simulation.attrib[name]


@pytest.mark.parametrize(
    ("code", "edit", "words"),
    [
        ("token-mismatch", put_token, ["{11111111", "different builds"]),
        ("log-category-undeclared", forget_categories, ["'logStatusError'"]),
        ("start-differs", put("Lag.TimeRR", start="3.0"), ["Lag.TimeRR", "2.0", "3.0"]),
        ("start-differs", put("In.Hold", start="true"), ["In.Hold"]),
        ("set-refused", put("Lag.Gain", max="5000.0", start="5000.0"), ["Lag.Gain"]),
    ],
)
def test_xml_and_binary_must_agree(
    fmus: dict[int, Path], version: int, tmp_path: Path, code: str, edit: Edit, words: list[str]
) -> None:
    report = check(mutate(fmus[version], tmp_path / "m.fmu", {MODEL: edit}))
    if code == "set-refused":
        report.findings = [f for f in report.findings if f.code != "start-differs"]
    alone(report, code, *words)


def test_flags_decide_what_is_asked_for(
    fmus: dict[int, Path], version: int, tmp_path: Path
) -> None:
    """What an FMU does not promise it need not keep."""
    path = rebuilt(fmus[version], tmp_path, {**NOT_TODAY, **FIXED_STEP}, edits={MODEL: no_flags})
    assert check(path).findings == []
    path = rebuilt(fmus[version], tmp_path, SHARED_GAIN, edits={MODEL: one_instance})
    assert check(path).findings == []


def test_a_missing_function_only_spares_the_trials_that_need_it(
    mutant: Callable[..., Report], version: int
) -> None:
    name = "SetFMUstate" if version == 2 else "SetFMUState"
    report = mutant({}, without=[name])
    alone(report, "symbol-missing", f"fmi{version}{name}")
    assert len(report.trials) == len(dynamic.TRIALS)


def test_without_do_step_nothing_else_is_judged(
    mutant: Callable[..., Report], version: int
) -> None:
    report = mutant({}, without=["DoStep"])
    alone(report, "symbol-missing", f"fmi{version}DoStep")
    assert any(f"fmi{version}DoStep" in sentence for sentence in report.not_judged)


def test_a_binary_that_does_not_load_is_not_run(fmus: dict[int, Path], tmp_path: Path) -> None:
    binary = package.binary_path("lag", 2, build.target_platform())
    report = check(mutate(fmus[2], tmp_path / "m.fmu", files={binary: b"garbage"}))
    alone(report, "binary-format", binary)
    assert report.not_judged == ["how it runs (binary-format)"]


# ---------------------------------------------------------------- the machinery


def test_systems_without_fork(
    fmus: dict[int, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dynamic, "Children", partial(Children, forks=False))
    report = check(fmus[3])
    assert (report.findings, len(report.trials)) == ([], len(dynamic.TRIALS))
    path = rebuilt(fmus[2], tmp_path, ABORT)
    alone(check(path), "crash", "SIGABRT", "DoStep at t = 1 s")
    path = rebuilt(fmus[2], tmp_path, HANG)
    alone(check(path, timeout=0.3), "hang", "DoStep at t = 1 s")


def test_a_mistake_of_the_checker_is_no_finding(
    fmus: dict[int, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dynamic, "perform", math.sqrt)  # of no number
    with pytest.raises(WorkError, match=r"sqrt is at fault:(.|\n)*TypeError"):
        check(fmus[2])
    assert WorkError.exit_code == 3


def test_an_fmu_that_fails_only_once_in_a_while_keeps_its_reference(
    fmus: dict[int, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A failure in one trial says what the FMU was doing."""
    run = Children.run

    def fail(self: Children, work: object, job: Job, watch: Watch) -> object:
        if job.trial == "token":
            return Death("crash", "SIGILL", "fmi3Instantiate")
        return run(self, work, job, watch)

    monkeypatch.setattr(Children, "run", fail)
    alone(check(fmus[3]), "crash", "SIGILL", "fmi3Instantiate, when a wrong token is offered")


@pytest.mark.parametrize(
    ("low", "high", "start"),
    [(-1.0, 1.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0), (None, None, 5.0), (0.0, None, 0.0)],
)
def test_inputs_move_within_their_range(
    low: float | None, high: float | None, start: float
) -> None:
    channel = Channel("u", 0, "Real", "input", "continuous", 1, start, low, high)
    values = [swing(channel, 0.1 * k) for k in range(100)]
    assert max(values) > min(values)
    assert all((low is None or v >= low) and (high is None or v <= high) for v in values)


@pytest.mark.parametrize(
    ("kind", "start", "low", "high", "exists"),
    [
        ("Real", 1.0, 0.0, 1.0, True), ("Real", 0.0, 0.0, 1.0, True),
        ("Real", 2.0, 2.0, 2.0, False), ("Real", None, None, None, False),
        ("Integer", 3, 3, 4, True), ("Integer", 3, 3, 3, False),
        ("Boolean", True, None, None, True), ("String", "a", None, None, False),
    ],
)  # fmt: skip
def test_another_value_of_the_range(
    kind: str, start: object, low: float | None, high: float | None, exists: bool
) -> None:
    channel = Channel("p", 0, kind, "parameter", "fixed", 1, start, low, high)
    other = other_value(channel)
    assert (other is not None) == exists
    if exists:
        assert other != start
        assert low is None or low <= other <= high


def test_a_process_that_does_not_start_is_no_finding(
    fmus: dict[int, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dynamic, "Children", Children)
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with pytest.raises(WorkError, match="did not start"):
        check(fmus[2])


def test_an_interrupted_check_leaves_no_process(
    fmus: dict[int, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As Ctrl+C does while a step hangs."""
    monkeypatch.setattr(dynamic, "Children", Children)
    file = tmp_path / "pid"
    note = f'FILE *f = fopen("{file}", "w"); fprintf(f, "%d", (int)getpid()); fclose(f);'
    path = rebuilt(fmus[2], tmp_path, {"DoStep": f"{note} for (;;) {{}}"})

    def interrupt(*_: object) -> None:
        if file.is_file() and file.read_text():
            raise KeyboardInterrupt

    read = "cosim.isolation.children.read_journal"
    monkeypatch.setattr(read, lambda _: interrupt() or (0, "", ""))
    with pytest.raises(KeyboardInterrupt):
        check(path)
    process = Path("/proc") / file.read_text()
    for _ in range(100):
        if not process.exists():
            return
        time.sleep(0.02)
    assert not process.exists()
