"""Real-time factors and loop overhead: `python tests/benchmarks/bench_loop.py`.

Everything is measured in this one process, on one thread. The loop's overhead per step is the time
of a run less the time of the same FMU stepped by bare C calls; beside it stands FMPy's
`simulate_fmu` on the same FMU, inputs and outputs.
"""

from __future__ import annotations

import contextlib
import statistics
import time
from collections.abc import Callable
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
from cosim.vehicle import builtin_fmu

SCENARIO = Path(__file__).parents[2] / "scenarios/laps/hockenheim_normal_class_a.yaml"
DURATION = 60
STEPS = round(DURATION / STEP_S)
ROUNDS = 5
INPUTS = [q.variable for q in INPUT_QUANTITIES]


def prepared(**blocks: Any) -> Assembly:
    """Return a run of the first minute of the lap."""
    scenario = load(SCENARIO, [f"duration={DURATION}"])
    return assemble(scenario, scenario.controllers[0], **blocks)


def whole_run() -> float:
    """Vehicle, driver, sensor, recorder."""
    return prepared().run(None).wall_time_s


def run_without_sensor() -> float:
    """Vehicle, driver, recorder."""
    return prepared(sensor=NoSensor()).run(None).wall_time_s


@cache
def lap() -> tuple[dict[str, Any], npt.NDArray[np.float64]]:
    """Return the run's start values and its inputs (steps, 7): everybody drives the same minute."""
    scenario = load(SCENARIO, [f"duration={DURATION}"])
    assembly = prepared(sensor=NoSensor())
    assembly.run(None)
    course = course_of(scenario)
    speed = speed_profile(course.track, STYLES[scenario.driver.style])
    start = builtin_start(course, float(speed[np.searchsorted(course.track.s, 0.0)]), True)
    groups = [assembly.recorder.group(name) for name in ("driver", "command")]
    return start, np.hstack(groups)[:STEPS].copy()


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


def median(measure: Callable[[], float]) -> float:
    """Return the median of some rounds [s]."""
    return statistics.median(measure() for _ in range(ROUNDS))


def main() -> None:
    """Measure and print a Markdown table."""
    bare, ours, fmpys = median(bare_steps), median(our_exchange), median(simulate_fmu)
    silent, whole, road = median(run_without_sensor), median(whole_run), median(road_loading)
    per_step = 1e6 / STEPS
    print(f"{DURATION} s of {SCENARIO.stem}, medians of {ROUNDS}, one thread\n")
    print("| what | time per step, us | times real time |\n|---|---|---|")
    rows = {
        "vehicle FMU alone (fmi3DoStep only)": bare,
        "vehicle FMU with all inputs and outputs, our calls": ours,
        "FMPy simulate_fmu, same FMU, inputs and outputs": fmpys,
        "run without sensor (vehicle, driver, recorder)": silent,
        "whole run": whole,
    }
    for what, seconds in rows.items():
        print(f"| {what} | {seconds * per_step:.1f} | {DURATION / seconds:.0f} |")
    exchange, loop, theirs = ours - bare, silent - bare, fmpys - bare
    print(
        f"\nexchange with the FMU: {exchange * per_step:.1f} us per step over the bare FMU, ",
        end="",
    )
    print(f"{exchange / theirs:.2f} of simulate_fmu's {theirs * per_step:.1f} us")
    print(f"loop with driver, recorder and controller: {loop * per_step:.1f} us per step, ", end="")
    print(f"{loop / theirs:.2f} of simulate_fmu's")
    print(f"loading FMU and road: {road:.2f} s, once per run")


if __name__ == "__main__":
    main()
