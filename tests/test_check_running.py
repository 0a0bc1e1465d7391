"""`cosim check` on FMUs that run: mutants of the fixture's C code, one defect each."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from fmu_face import FIXTURE, ROOT, build
from fmu_mutants import MODEL, Edit, entry, mutate, put, version_of
from fmu_rebuild import Changes, rebuilt

from cosim.check import dynamic
from cosim.check.checker import check
from cosim.check.child import CheckerError, Children, Failure
from cosim.check.finding import Report
from cosim.check.trials.bench import swing
from cosim.check.trials.job import Answer, Channel
from cosim.check.trials.rules import other_value

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="compiles ELF libraries")


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[int, Path]:
    return dict(zip((2, 3), build.build(FIXTURE, tmp_path_factory.mktemp("fmus")), strict=True))


class Shared(Children):
    """One server of forks for many checks, which is quicker than one for each."""

    def __exit__(self, *_: object) -> None:
        """Stay."""

    def again(self, timeout: float) -> Shared:
        self._timeout = timeout
        return self


@pytest.fixture(scope="module")
def shared() -> Iterator[Shared]:
    children = Shared(20.0)
    yield children
    Children.__exit__(children)


@pytest.fixture(autouse=True)
def _quick(shared: Shared, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dynamic, "Children", shared.again)


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def version(request: pytest.FixtureRequest) -> int:
    return int(request.param)


@pytest.fixture
def mutant(fmus: dict[int, Path], version: int, tmp_path: Path) -> Callable[..., Report]:
    """Checks a mutant of the fixture, compiled with changed sources."""

    def make(changes: Changes, timeout: float = 20.0, **others: object) -> Report:
        return check(rebuilt(fmus[version], tmp_path, changes, **others), timeout=timeout)

    return make


def alone(report: Report, code: str, *words: str) -> None:
    """Assert that this code and no other was found, with all words in one of its messages."""
    assert report.codes == [code], [(f.code, f.message) for f in report.findings]
    said = [f"{f.where} {f.message}" for f in report.findings]
    assert any(all(word in text for word in words) for text in said), said


def test_the_fixture_is_sound(mutant: Callable[..., Report]) -> None:
    report = mutant([])
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


# ---------------------------------------------------------------- places in the C sources

OUTPUTS = r"m->v\.Out_Above ="  # the end of the calculation of the outputs
INITIALISE = r"(?<=model_initialise\(Model \*m\)\n{)"
PREPARE = r"(?<=model_prepare\(Model \*m\)\n{)"
STEP = r"(?<=model_step\(Model \*m, double t, double h\)\n{)"
TARGET = r"derived->gain \* m->v\.Lag_Gain"
TOP = r"const size_t model_state_size"
RESET = r"start_over\(instance\);\n    return MODEL_OK;"
LATE = "if (t > 0.95)"


def lag(*places_and_texts: str) -> Changes:
    """Changes to lag.c: the text before each place, which stays."""
    pairs = zip(places_and_texts[::2], places_and_texts[1::2], strict=True)
    return [("lag.c", f"(?={place})" if "?<=" not in place else place, text)
            for place, text in pairs]  # fmt: skip


def refuse(text: str) -> str:
    return f'{{ model_log(m, MODEL_ERROR, "logGain", "{text}"); return MODEL_ERROR; }}'


def state(function: str, arguments: str, text: str) -> tuple[str, str, str]:
    """A change at the beginning of a function of state.c."""
    head = f"ModelStatus {function}(Instance *instance, const char *function, {arguments})\n{{"
    return ("state.c", f"(?<={re.escape(head)})", text)


NOT_TODAY = 'return refuse(instance, "%s: not today.", function);'
UNGUARDED = ("values.c", r"info->role == OUTPUT && !isfinite", "0 && !isfinite")  # let NaN pass

MUTANTS: list[tuple[str, Changes, list[str]]] = [
    ("output-not-finite", [*lag(OUTPUTS, "if (m->v.In_Hold) m->v.Out[1] = NAN; "),
                           *lag(STEP, f"{LATE} m->v.In_Hold = 1;"), UNGUARDED],
     ["Out.FR is nan", "t = 1.1 s"]),
    ("output-not-finite", [*lag(OUTPUTS, "m->v.Out[2] = INFINITY;"), UNGUARDED],
     ["Out.RL is inf", "t = 0 s"]),
    ("step-failed", lag(STEP, LATE + refuse("the wheel came off")),
     ["t = 1 s", "answered Error: the wheel came off"]),
    ("initialise-failed", lag(INITIALISE, refuse("no static start")),
     ["ExitInitializationMode", "no static start"]),
    ("inputs-refused", lag(STEP, "if (m->v.In_u != 1.0)" + refuse("only 1 rad")),
     ["move", "only 1 rad"]),
    ("call-failed", lag(INITIALISE, "static int lives; if (++lives > 150)" + refuse("too old")),
     ["too old"]),
    ("outputs-constant", lag(OUTPUTS, "m->v.Out[3] = 0.5;"), ["1 of 4 continuous", "Out.RR"]),
    ("not-deterministic", lag(TOP, "#include <time.h>\n", OUTPUTS,
     "struct timespec now; timespec_get(&now, 1); m->v.Out[0] += 1e-12 * now.tv_nsec;"),
     ["Out.FL", "two runs"]),
    ("step-size-refused", lag(STEP, "if (fabs(h - 0.1) > 1e-9)" + refuse("fixed step")),
     ["0.05 s", "0.1 s is the default", "fixed step"]),
    ("thread-bound", lag(TOP, "static _Thread_local int here; static int *home;", PREPARE,
     "home = &here;", STEP, "if (home != &here)" + refuse("wrong thread")),
     ["another thread", "wrong thread"]),
    ("path-sensitive", lag(PREPARE, "if (strchr(m->resources, ' '))" + refuse("a space")),
     ["Prüfstand", "a space"]),
    ("cannot-load", lag(TOP, "extern int nowhere; int *use = &nowhere;"),
     ["undefined symbol: nowhere"]),
    ("instances-share", [*lag(TOP, "static double gain;", INITIALISE, "gain = m->v.Lag_Gain;"),
                         ("lag.c", TARGET, "derived->gain * gain")],
     ["static variables", "Out."]),
    ("instances-share", [("instance.c", r"(?=Instance \*instance = calloc)",
     "static int alive; if (alive) return NULL; alive = 1;"),
     ("instance.c", r"    free\(instance\);\n}", "    free(instance); alive = 0;\n}"),
     ("instance.c", "static int alive;", ""),
     ("instance.c", r"(?=static char)", "static int alive;")],
     ["second instance is refused"]),
    ("state-not-restored", [state("state_set", "const void *state", "return MODEL_OK;")],
     ["SetFMU", "right after"]),
    ("state-not-restored", [("state.c", r"saved->state, model_state_size\);\n}",
     "saved->state, model_state_size - 8);\n}")], ["replay", "Out.RR", "instead of"]),
    ("state-not-restored", [("state.c", r"(?=memcpy\(&instance->progress)", "if (0) ")],
     ["saved time are refused", "communication point"]),
    ("state-call-failed", [state("state_get", "void **state", NOT_TODAY)], ["GetFMU", "not today"]),
    ("serialise-failed", [state("state_size", "const void *state, size_t *size", NOT_TODAY)],
     ["SerializedFMU", "not today"]),
    ("serialised-state-differs", [("state.c", r"memcpy\(saved, bytes, size\);",
     "memcpy(saved, bytes, size); memset(saved->state, 0, 8);")], ["Out.FL", "bytes"]),
    ("reset-incomplete", [("instance.c", RESET, "return MODEL_OK;")],
     ["Reset", "not as it was after instantiation"]),
    ("reset-incomplete", [("instance.c", RESET, "Variables v = instance->model.v; "
     "start_over(instance); instance->model.v = v; return MODEL_OK;")],
     ["Reset", "Out.", "instead of"]),
    ("reset-incomplete", [("instance.c", RESET, NOT_TODAY)], ["Reset answered Error", "not today"]),
    ("token-not-checked", [("instance.c", r"\|\| strcmp\(token, model_token\) != 0", "")],
     ["wrong", "{00000000"]),
    ("wrong-order-accepted", [("instance.c", r"check_phase\(instance, function, STEPPING\)", "0"),
     *lag(STEP, "if (!m->derived) return MODEL_OK;")],
     ["DoStep before initialisation answers OK"]),
    ("wrong-order-accepted", [("instance.c", r"check_phase\(instance, function, INITIALIZATION\)",
     "0")], ["ExitInitializationMode without EnterInitializationMode"]),
    ("stop-time-ignored", [("instance.c", r"progress->stop_defined && t \+ h", "0 && t + h")],
     ["past the stop time 0.2 s"]),
    ("terminate-failed", [(f"fmi{v}.c", r"STEPPING \| FAILED\)\)", "STEPPING | FAILED) || 1)")
     for v in (2, 3)], ["Terminate"]),
    ("value-not-kept", [("fmi2.c", r"= value\[k\]\)", "= vr[k] == 9 ? 0.0 : value[k])"),
     ("fmi3.c", r"= values\[k\]\)", "= vr[k] == 9 ? 0.0 : values[k])")],
     ["Lag.Start", "reads back 0.0"]),
    ("set-refused", [("values.c", r"(?=if \(!isfinite\(value\)\))",
     'if (!strcmp(info->name, "Lag.Pressure") && value > 1) return refuse(instance, "too high");')],
     ["Lag.Pressure", "too high"]),
    ("start-differs", [("variables.c", r"\.Lag_Gain = 1\.0", ".Lag_Gain = 2.0")],
     ["Lag.Gain starts at 2.0 in the binary, but at 1.0 in the XML"]),
    ("memory-growth", [("instance.c", r"    free\(instance\);\n}", "}")], ["KiB each"]),
    ("version-mismatch", [("fmi2.c", r"return fmi2Version;", 'return "1.0";'),
     ("fmi3.c", r"return fmi3Version;", 'return "2.0";')], ["GetVersion answers"]),
    ("time-wrong", [("values.c", r"&instance->progress\.time", "&instance->progress.start_time")],
     ["time is 0 s after the step to t = 0.1 s"]),
    ("time-wrong", [("fmi3.c", r"\*lastSuccessfulTime = i->progress.time",
     "*lastSuccessfulTime = 7")], ["lastSuccessfulTime is 7 s"]),
    ("crash", lag(STEP, f"{LATE} *(volatile int *)0 = 1;"),
     ["SIGSEGV", "DoStep at t = 1 s", "with its default inputs"]),
    ("crash", lag(STEP, f'{LATE} {{ fprintf(stderr, "assertion: x > 0\\n"); abort(); }}'),
     ["SIGABRT", "it printed: assertion: x > 0"]),
    ("crash", [("instance.c", RESET, "abort();")], ["SIGABRT", "Reset", "while it is reset"]),
    ("crash", [("instance.c", r"    free\(instance\);\n}", "    abort();\n}")], ["FreeInstance"]),
    ("process-ended", lag(STEP, f"{LATE} exit(3);"),
     ["ended the whole process", "DoStep at t = 1 s"]),
]  # fmt: skip


def cases() -> Iterator[object]:
    """Each mutant of the FMI layer in both versions; those of the model, which knows no FMI, in
    turn.
    """
    for i, (code, changes, words) in enumerate(MUTANTS):
        touched = {file for file, _, _ in changes}
        both = (3,) if code == "time-wrong" else (2, 3)  # FMI 2.0 tells no time
        for version in (2 + i % 2,) if touched <= {"lag.c"} else both:
            yield pytest.param(version, code, changes, words, id=f"fmi{version}-{code}{i}")


@pytest.mark.parametrize(("version", "code", "changes", "words"), list(cases()))
def test_a_defect_that_shows_in_running_is_named(
    mutant: Callable[..., Report], code: str, changes: Changes, words: list[str]
) -> None:
    alone(mutant(changes), code, *words)


def test_a_call_that_does_not_return(mutant: Callable[..., Report]) -> None:
    begin = time.perf_counter()
    report = mutant(lag(STEP, f"{LATE} for (;;) {{}}"), timeout=0.3)
    alone(report, "hang", "DoStep at t = 1 s", "did not return within 0.3 s", "default inputs")
    assert report.not_judged == ["everything that needs it to run with its defaults"]
    assert time.perf_counter() - begin < 10.0


def test_a_hang_in_one_trial_leaves_the_others(mutant: Callable[..., Report]) -> None:
    report = mutant([("instance.c", RESET, "for (;;) {}")], timeout=0.3)
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
    broken = [
        state("state_get", "void **state", NOT_TODAY),
        *lag(STEP, "if (fabs(h - 0.1) > 1e-9)" + refuse("fixed step")),
    ]
    path = rebuilt(fmus[version], tmp_path, broken, edits={MODEL: no_flags})
    assert check(path).findings == []
    static = [*lag(TOP, "static double gain;", INITIALISE, "gain = m->v.Lag_Gain;"),
              ("lag.c", TARGET, "derived->gain * gain")]  # fmt: skip
    path = rebuilt(fmus[version], tmp_path, static, edits={MODEL: one_instance})
    assert check(path).findings == []


def test_a_missing_function_only_spares_the_trials_that_need_it(
    mutant: Callable[..., Report], version: int
) -> None:
    name = "fmi2SetFMUstate" if version == 2 else "fmi3SetFMUState"
    report = mutant([(f"fmi{version}.c", rf"fmi\dStatus {name}\(", "static int gone(")])
    alone(report, "symbol-missing", name)
    assert len(report.trials) == len(dynamic.TRIALS)


def test_without_do_step_nothing_else_is_judged(
    mutant: Callable[..., Report], version: int
) -> None:
    name = f"fmi{version}DoStep"
    report = mutant([(f"fmi{version}.c", rf"fmi\dStatus {name}\(", "static int gone(")])
    alone(report, "symbol-missing", name)
    assert any(name in sentence for sentence in report.not_judged)


def test_a_binary_that_does_not_load_is_not_run(fmus: dict[int, Path], tmp_path: Path) -> None:
    path = mutate(fmus[2], tmp_path / "m.fmu", files={"binaries/linux64/lag.so": b"garbage"})
    report = check(path)
    alone(report, "binary-format", "binaries/linux64/lag.so")
    assert report.not_judged == ["how it runs (binary-format)"]


# ---------------------------------------------------------------- the machinery


def test_systems_without_fork(
    fmus: dict[int, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dynamic, "Children", lambda timeout: Children(timeout, forks=False))
    report = check(fmus[3])
    assert (report.findings, len(report.trials)) == ([], len(dynamic.TRIALS))
    path = rebuilt(fmus[2], tmp_path, lag(STEP, f"{LATE} abort();"))
    alone(check(path), "crash", "SIGABRT", "DoStep at t = 1 s")
    path = rebuilt(fmus[2], tmp_path, lag(STEP, f"{LATE} for (;;) {{}}"))
    alone(check(path, timeout=0.3), "hang", "DoStep at t = 1 s")


def test_a_mistake_of_the_checker_is_no_finding(
    fmus: dict[int, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Children, "run", lambda self, job: Answer(broken="ZeroDivisionError"))
    with pytest.raises(CheckerError, match="ZeroDivisionError"):
        check(fmus[2])
    assert CheckerError.exit_code == 3


def test_an_fmu_that_fails_only_once_in_a_while_keeps_its_reference(
    fmus: dict[int, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A failure in one trial says what the FMU was doing."""
    run = Children.run

    def fail(self: Children, job: object) -> object:
        return Failure("crash", "it crashed") if job.trial == "token" else run(self, job)

    monkeypatch.setattr(Children, "run", fail)
    alone(check(fmus[3]), "crash", "it crashed, when a wrong token is offered")


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
