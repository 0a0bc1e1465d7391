"""Trials of plain running: with defaults, with moving inputs, again, with other steps."""

from __future__ import annotations

import ctypes
import json
import math
from pathlib import Path

from cosim.check.trials.bench import ROWS, Bench, Row, Watch, finite_check, first_difference
from cosim.check.trials.instance import Instance
from cosim.check.trials.job import Answer
from cosim.check.trials.library import WARNING, Refused, status_name


def default(bench: Bench, answer: Answer) -> None:
    """Instantiate, initialise and run the default experiment with the default inputs."""
    _version(bench, answer)
    answer.fatal = True  # until the first step has been taken
    try:
        instance = bench.instance()
    except Refused as refusal:
        words = refusal.words or "it says nothing"
        answer.add("instantiate-failed", refusal.function, f"{refusal.function} refuses: {words}")
        return
    try:
        instance.initialise()
    except Refused as refusal:
        answer.add(
            "initialise-failed", refusal.function,
            f"the start values of the XML do not initialise it: {refusal}",
        )  # fmt: skip
        return
    _experiment(bench, instance, answer)
    try:
        instance.do("Terminate")
    except Refused as refusal:
        answer.add("terminate-failed", refusal.function, f"after the last step {refusal}")
    instance.free()
    answer.fatal = bool({code for code, _, _ in answer.findings} & {"step-failed"})


def _version(bench: Bench, answer: Answer) -> None:
    function = bench.library.full_name("GetVersion")
    said = (bench.library.call("GetVersion", ctypes.c_char_p) or b"").decode("utf-8", "replace")
    if not said.startswith(f"{bench.job.major}."):
        answer.add(
            "version-mismatch", function,
            f"{function} answers '{said}', but modelDescription.xml is of FMI {bench.job.major}.0",
        )  # fmt: skip


def _experiment(bench: Bench, instance: Instance, answer: Answer) -> None:
    watch, seen = Watch(instance, bench.watched), set[str]()
    finite_check(answer, watch, watch.read(), bench.job.start, seen)
    for k in range(bench.steps()):
        try:
            instance.step(bench.at(k), bench.job.step)
        except Refused as refusal:
            answer.add(
                "step-failed", refusal.function,
                f"the step from t = {bench.at(k):.6g} s by {bench.job.step:.6g} s, with default "
                f"inputs: {refusal}",
            )  # fmt: skip
            return
        finite_check(answer, watch, watch.read(), bench.at(k + 1), seen)
        if not _times(bench, instance, answer, k + 1) or instance.ended or bench.out_of_time:
            return


def _times(bench: Bench, instance: Instance, answer: Answer, k: int) -> bool:
    """Whether the times that the FMU tells are those of the steps."""
    t = bench.at(k)
    slack = 1e-6 * bench.job.step + 1e-12 * abs(t)
    told = {}
    if bench.time is not None and bench.time.is_float:
        told[bench.time.name] = float(instance.get(bench.time)[0])
    if instance.last_time is not None:
        told["lastSuccessfulTime"] = instance.last_time
    for name, value in told.items():
        if abs(value - t) > slack:
            answer.add(
                "time-wrong", name, f"{name} is {value:.12g} s after the step to t = {t:.12g} s"
            )
            return False
    return True


def moved(bench: Bench, answer: Answer) -> None:
    """Run with moving inputs; keep the rows for the other trials."""
    instance, watch = bench.ready()
    rows, seen = [watch.read()], set[str]()
    for k in range(min(bench.steps(), ROWS)):
        try:
            rows += bench.rows(instance, watch, k, k + 1)
        except Refused as refusal:
            if k == 0 or bench.job.moving:
                answer.add("inputs-refused", refusal.function, _refusal(bench, refusal, k))
                answer.fatal = True
                return
            break
        finite_check(answer, watch, rows[-1], bench.at(k + 1), seen)
        if instance.ended or bench.out_of_time:
            break
    Path(bench.job.reference).write_text(json.dumps(rows), encoding="utf-8")
    instance.free()
    if bench.job.moving and bench.inputs and len(rows) > 2:
        _constant(watch.names, [c.variability for c in watch.channels], rows, answer)


def _refusal(bench: Bench, refusal: Refused, k: int) -> str:
    ranges = "within their ranges" if bench.inputs else ""
    return f"with inputs that move a little {ranges} at t = {bench.at(k):.6g} s: {refusal}"


def _constant(names: list[str], kinds: list[str], rows: list[Row], answer: Answer) -> None:
    still = [
        name
        for i, name in enumerate(names)
        if kinds[i] == "continuous"
        and math.isfinite(rows[0][i])
        and all(row[i] == rows[0][i] for row in rows)
    ]
    if still:
        shown = ", ".join(still[:8]) + (f" and {len(still) - 8} more" if len(still) > 8 else "")
        answer.add(
            "outputs-constant", still[0],
            f"{len(still)} of {kinds.count('continuous')} continuous outputs stay constant over "
            f"{len(rows) - 1} steps with moving inputs: {shown}",
        )  # fmt: skip


def reference(bench: Bench) -> list[Row]:
    """Return the rows of `moved`, which ran in a process of its own."""
    rows: list[Row] = json.loads(Path(bench.job.reference).read_text(encoding="utf-8"))
    return rows


def again(bench: Bench, answer: Answer) -> None:
    """Run once more in another process: the bits must be the same."""
    expected = reference(bench)
    instance, watch = bench.ready()
    found = [watch.read(), *bench.rows(instance, watch, 0, len(expected) - 1)]
    parted = first_difference(bench, watch.names, expected, found, -1)
    if parted:
        answer.fatal = True
        answer.add(
            "not-deterministic", parted.split(" ")[0],
            f"two runs with the same inputs differ: {parted}",
        )  # fmt: skip
    instance.free()


def step_size(bench: Bench, answer: Answer) -> None:
    """Steps of other sizes, where the FMU says that it can handle them."""
    if "variable-step" not in bench.job.flags:
        return
    h, internal = bench.job.step, bench.job.internal_step
    sizes = [2 * internal, 3 * internal] if internal else [0.5 * h, 1.5 * h, 0.37 * h]
    instance, watch = bench.ready()
    t = bench.job.start
    for size in sizes:
        status = instance.try_step(t, size)
        if status > WARNING:
            function = bench.library.full_name("DoStep")
            answer.add(
                "step-size-refused", function,
                "canHandleVariableCommunicationStepSize is true, but a step of "
                f"{size:.6g} s, where {h:.6g} s is the default, answers {status_name(status)}"
                + (f": {instance.words()}" if instance.words() else ""),
            )  # fmt: skip
            return
        t += size
    watch.read()
    instance.free()


def stop_time(bench: Bench, answer: Answer) -> None:
    """A step past the stop time answers Error (FMI 2.0.5, section 4.2.1; FMI 3.0, section 2.3)."""
    h, instance = bench.job.step, bench.instance()
    try:
        instance.initialise(stop=bench.at(2))
        instance.step(bench.at(0), h)
        instance.step(bench.at(1), h)
    except Refused:
        return
    if instance.try_step(bench.at(2), h) <= WARNING:
        answer.add(
            "stop-time-ignored", bench.library.full_name("DoStep"),
            f"a step past the stop time {bench.at(2):.6g} s that it was given answers OK",
        )  # fmt: skip
    instance.free()


def odd_path(bench: Bench, answer: Answer) -> None:
    """Run from a folder whose name has spaces and letters beyond ASCII."""
    folder = Path(bench.job.resources).parent.name
    try:
        instance, watch = bench.ready()
        bench.rows(instance, watch, 0, 1)
    except Refused as refusal:
        answer.add(
            "path-sensitive", refusal.function,
            f"in a folder called '{folder}' it does not run: {refusal}",
        )  # fmt: skip
        return
    instance.free()
