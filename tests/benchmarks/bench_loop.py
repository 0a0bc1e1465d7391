"""Real-time factors and loop overhead: `python tests/benchmarks/bench_loop.py`.

Everything is measured in this one process, on one thread. The loop's overhead per step is the time
of a run less the time of the same FMU stepped by bare C calls; beside it stands FMPy's
`simulate_fmu` on the same FMU, inputs and outputs.
"""

from __future__ import annotations

import contextlib
import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim.assembly import STEP_S, Assembly, assemble
from cosim.course import course_of
from cosim.dataset import NoSensor
from cosim.fmi import Description, Slave
from cosim.quantities import INPUT_QUANTITIES, OUTPUT_QUANTITIES
from cosim.scenario.load import load
from cosim.speed_profile import STYLES, speed_profile
from cosim.start import builtin_start
from cosim.testbench import State
from cosim.vehicle import builtin_fmu

SCENARIO = Path(__file__).parents[2] / "scenarios/paper/hockenheim_normal.yaml"
DURATION = 60
STEPS = round(DURATION / STEP_S)
ROUNDS = 7
INPUTS = [q.variable for q in INPUT_QUANTITIES]


def prepared(**blocks: Any) -> Assembly:
    """Return a run of the first minute of the lap."""
    scenario = load(SCENARIO, [f"duration={DURATION}", "road.surface=A"])
    return assemble(scenario, scenario.controllers[0], **blocks)


def whole_run() -> float:
    """Vehicle, driver, sensor, recorder."""
    return prepared().run(None).wall_time_s


def run_without_sensor() -> float:
    """Vehicle, driver, recorder."""
    return prepared(sensor=NoSensor()).run(None).wall_time_s


class Replay:
    """A driver that repeats recorded commands (steps, 3)."""

    finished = False

    def __init__(self, commands: npt.NDArray[np.float64]) -> None:
        self._commands = np.vstack([commands, commands[-1:]])

    def step(self, k: int, state: State) -> npt.NDArray[np.float64]:
        """Return the recorded command."""
        row: npt.NDArray[np.float64] = self._commands[k]
        return row


def run_replayed() -> float:
    """The loop with vehicle block, checks and recorder: what `simulate_fmu` does too."""
    assembly = prepared(sensor=NoSensor())
    assembly.blocks = replace(assembly.blocks, driver=Replay(lap()[1][:, :3]))
    return assembly.run(None).wall_time_s


@cache
def lap() -> tuple[dict[str, Any], npt.NDArray[np.float64]]:
    """Return the run's start values and its inputs (steps, 7): everybody drives the same minute."""
    scenario = load(SCENARIO, [f"duration={DURATION}", "road.surface=A"])
    assembly = prepared(sensor=NoSensor())
    assembly.run(None)
    course = course_of(scenario)
    speed = speed_profile(course.track, STYLES[scenario.driver.style])
    speed_0 = float(speed[np.searchsorted(course.track.s, 0.0)])
    start = builtin_start(course, course.track, speed_0, True, None)
    groups = [assembly.recorder.group(name) for name in ("driver", "command")]
    return start, np.hstack(groups)[:STEPS].copy()


@cache
def master() -> ctypes.CDLL:
    """Return the master in C, compiled."""
    source = Path(__file__).with_name("replay.c")
    library = Path(tempfile.mkdtemp()) / "replay.so"
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", source, "-o", library], check=True)
    return ctypes.CDLL(str(library))


def alone() -> float:
    """The FMU in a loop in C: inputs set, fmi3DoStep, nothing read."""
    start, inputs = lap()
    slave = Slave(Description(builtin_fmu()), INPUTS, [])
    slave.initialise(start)
    fmu, variables = slave._fmu, slave.description.variables
    references = np.array([variables[name].valueReference for name in INPUTS], np.uint32)
    put, step = (
        ctypes.cast(getattr(fmu.dll, f), ctypes.c_void_p) for f in ("fmi3SetFloat64", "fmi3DoStep")
    )
    arguments = (
        put, step, ctypes.c_void_p(fmu.component), ctypes.c_void_p(references.ctypes.data),
        ctypes.c_void_p(inputs.ctypes.data), ctypes.c_size_t(len(INPUTS)), STEPS,
        ctypes.c_double(STEP_S),
    )  # fmt: skip
    begin = time.perf_counter()
    done = master().replay(*arguments)
    elapsed = time.perf_counter() - begin
    slave.close()
    assert done == STEPS
    return elapsed


def bare_steps() -> float:
    """The FMU's own stepping: inputs replayed, fmi3DoStep with wrapped arguments, nothing read."""
    return replayed([])


def our_exchange() -> float:
    """The same with every output of the loop read at each step."""
    return replayed([q.variable for q in OUTPUT_QUANTITIES])


def replayed(outputs: list[str]) -> float:
    """Drive the recorded minute once; loading and initialising are not counted."""
    start, inputs = lap()
    slave = Slave(Description(builtin_fmu()), INPUTS, outputs)
    slave.initialise(start)
    begin = time.perf_counter()
    for k in range(STEPS):
        slave.inputs[:] = inputs[k]
        if outputs:
            slave.read()
        slave.step(k, STEP_S)
    elapsed = time.perf_counter() - begin
    slave.close()
    return elapsed


def simulate_fmu() -> float:
    """FMPy's own loop on the same FMU, inputs and outputs; loading and initialising taken off."""
    import fmpy

    start, inputs = lap()
    description = fmpy.read_model_description(str(builtin_fmu()))
    folder = fmpy.extract(str(builtin_fmu()))
    signals = np.zeros(STEPS + 1, dtype=[("time", float), *((n, float) for n in INPUTS)])
    signals["time"] = np.arange(STEPS + 1) * STEP_S
    for column, name in enumerate(INPUTS):
        signals[name][:STEPS] = inputs[:, column]

    def simulate(stop: float) -> float:
        begin = time.perf_counter()
        with contextlib.redirect_stdout(None):  # it warns of inputs that are not given
            fmpy.simulate_fmu(
                folder, model_description=description, stop_time=stop, step_size=STEP_S,
                output_interval=STEP_S, start_values=start, input=signals,
                output=[q.variable for q in OUTPUT_QUANTITIES],
            )  # fmt: skip
        return time.perf_counter() - begin

    return simulate(DURATION) - simulate(STEP_S)


def road_loading() -> float:
    """Reading the lap's OpenCRG file, at its one-off cost."""
    begin = time.perf_counter()
    slave = Slave(Description(builtin_fmu()), [], [])
    slave.initialise(lap()[0])
    elapsed = time.perf_counter() - begin
    slave.close()
    return elapsed


def best(measures: dict[str, Callable[[], float]]) -> dict[str, float]:
    """Return each measure's shortest time [s]; the rounds are interleaved, so that all share the
    machine's good and bad moments.
    """
    rounds = [{name: measure() for name, measure in measures.items()} for _ in range(ROUNDS)]
    return {name: min(one[name] for one in rounds) for name in measures}


def main() -> None:
    """Measure and print a Markdown table."""
    times = best(MEASURES)
    per_step = 1e6 / STEPS
    print(f"{DURATION} s of {SCENARIO.stem}, best of {ROUNDS} interleaved rounds, one thread\n")
    print("| what | time per step, us | times real time |\n|---|---|---|")
    for what, seconds in times.items():
        print(f"| {what} | {seconds * per_step:.1f} | {DURATION / seconds:.0f} |")
    _, bare, ours, theirs, replayed_loop, silent, _ = times.values()
    print(f"\nover the bare FMU: simulate_fmu {(theirs - bare) * per_step:.1f} us a step")
    parts = {"outputs read": ours, "loop and recorder": replayed_loop, "with the driver": silent}
    for what, seconds in parts.items():
        share = (seconds - bare) / (theirs - bare)
        print(f"{what}: {(seconds - bare) * per_step:.1f} us, {share:.2f} of that")
    print(f"loading FMU and road: {min(road_loading() for _ in range(3)):.2f} s, once per run")


MEASURES = {
    "vehicle FMU alone, inputs replayed by a loop in C": alone,
    "vehicle FMU alone, by our calls from Python": bare_steps,
    "vehicle FMU with all outputs read, our calls": our_exchange,
    "FMPy simulate_fmu, same FMU, inputs and outputs": simulate_fmu,
    "loop and recorder, driver's commands replayed": run_replayed,
    "run without sensor (vehicle, driver, recorder)": run_without_sensor,
    "whole run": whole_run,
}

if __name__ == "__main__":
    main()
