"""Real-time factors and loop overhead: `python tests/benchmarks/bench_loop.py`.

Everything is measured in this one process, on one thread. The loop's overhead per step is the time
of a run less the time of the same FMU stepped by bare C calls; beside it stands FMPy's
`simulate_fmu` on the same FMU, inputs and outputs.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from cosim.assembly import STEP_S, Assembly, assemble
from cosim.dataset import NoSensor
from cosim.fmi import Description, Slave
from cosim.quantities import INPUT_QUANTITIES, OUTPUT_QUANTITIES
from cosim.scenario.load import load
from cosim.vehicle import builtin_fmu

SCENARIO = Path(__file__).parents[2] / "scenarios/laps/hockenheim_normal_class_a.yaml"
DURATION = 60
STEPS = round(DURATION / STEP_S)
ROUNDS = 5


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


def start_values() -> dict[str, Any]:
    """Return what the run above gives the FMU, so that all drive the same road."""
    from cosim.course import course_of
    from cosim.start import builtin_start

    course = course_of(load(SCENARIO, []))
    return builtin_start(course, 30.0, True)


def bare_steps() -> float:
    """The FMU's own stepping: nothing but fmi3DoStep with wrapped arguments, the car rolling
    straight on.
    """
    slave = Slave(Description(builtin_fmu()), [], [])
    slave.initialise(start_values())
    begin = time.perf_counter()
    for k in range(STEPS):
        slave.step(k, STEP_S)
    elapsed = time.perf_counter() - begin
    slave.close()
    return elapsed


def our_exchange() -> float:
    """The same with 7 inputs set and every output of the loop read at each step."""
    inputs = [q.variable for q in INPUT_QUANTITIES]
    outputs = [q.variable for q in OUTPUT_QUANTITIES]
    slave = Slave(Description(builtin_fmu()), inputs, outputs)
    slave.initialise(start_values())
    begin = time.perf_counter()
    for k in range(STEPS):
        slave.read()
        slave.step(k, STEP_S)
    elapsed = time.perf_counter() - begin
    slave.close()
    return elapsed


def simulate_fmu() -> float:
    """FMPy's own loop on the same FMU, inputs and outputs; loading and initialising taken off."""
    import fmpy

    description = fmpy.read_model_description(str(builtin_fmu()))
    folder = fmpy.extract(str(builtin_fmu()))
    names = [q.variable for q in INPUT_QUANTITIES]
    signals = np.zeros(STEPS + 1, dtype=[("time", float), *((n, float) for n in names)])
    signals["time"] = np.arange(STEPS + 1) * STEP_S

    def simulate(stop: float) -> float:
        begin = time.perf_counter()
        fmpy.simulate_fmu(
            folder, model_description=description, stop_time=stop, step_size=STEP_S,
            output_interval=STEP_S, start_values=start_values(), input=signals,
            output=[q.variable for q in OUTPUT_QUANTITIES],
        )  # fmt: skip
        return time.perf_counter() - begin

    return simulate(DURATION) - simulate(STEP_S)


def road_loading() -> float:
    """Reading the lap's OpenCRG file, at its one-off cost."""
    begin = time.perf_counter()
    slave = Slave(Description(builtin_fmu()), [], [])
    slave.initialise(start_values())
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
