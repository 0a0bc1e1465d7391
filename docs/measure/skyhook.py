"""Ride over the skyhook gain, on the true suspension velocity: the table of docs/closed-loop.md.

`python docs/measure/skyhook.py` drives the closed-loop scenario once per gain and prints Markdown.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from cosim.assembly import assemble
from cosim.dataset import NoSensor
from cosim.scenario.load import load

SCENARIO = Path(__file__).parents[2] / "scenarios" / "closed_loop" / "closed_loop_class_c_50.yaml"
GAINS = (1000.0, 2000.0, 3000.0, 3500.0, 4000.0, 6000.0, 8000.0, 12000.0)


def controllers() -> Iterator[tuple[str, str]]:
    """Yield the controllers to compare, as a scenario has them."""
    yield "passive", "kind: passive"
    yield "fixed soft", "kind: fixed, command: 0"
    yield "fixed half", "kind: fixed, command: 0.5"
    for gain in GAINS:
        yield (
            f"skyhook {gain:.0f} N s/m",
            f"kind: skyhook, feedback: truth, gain_ns_per_m: {gain}",
        )


def main() -> None:
    """Print the table."""
    print("| controller | a_w, m/s2 | deflection, mm | tyre load, N |\n|---|---|---|---|")
    for name, settings in controllers():
        scenario = load(SCENARIO, ["limits=[]", f"controllers=[{{{settings}}}]"])
        figures = assemble(scenario, scenario.controllers[0], NoSensor()).run(None).comfort
        a, d, f = (
            figures["weighted_acceleration_m_s2"],
            figures["deflection_rms_m"],
            figures["tyre_load_rms_n"],
        )
        print(f"| {name} | {a:.3f} | {1e3 * d:.2f} | {f:.0f} |")


if __name__ == "__main__":
    main()
