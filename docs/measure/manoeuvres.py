"""How the paper's manoeuvres were driven: `make manoeuvres` writes docs/paper-scenarios.md."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

from evaluated import ROOT
from markdown_tables import fill, table

PAGE = ROOT / "docs" / "paper-scenarios.md"


@dataclass(frozen=True)
class Driven:
    """A run: its row in Table 4, duration [s], the manoeuvre's figures, none for a lap, and the
    peak share of its grip that each tyre uses [%].
    """

    row: str
    simulated_s: float
    figures: dict[str, float]
    grip: tuple[float, ...]


def drive(file: Path) -> Driven:
    """Run one scenario on its own surface, the smooth one."""
    from cosim.assembly import assemble
    from cosim.scenario.load import load

    scenario = load(file)
    result = assemble(scenario, scenario.controllers[0]).run(None)
    grip = tuple(wheel["peak_percent"] for wheel in result.grip.values())
    return Driven(str(scenario.paper_row), result.simulated_s, dict(result.manoeuvre), grip)


def main() -> None:
    """Drive all rows on two processes and write the page."""
    from sensor.paper import paper_rows

    files = sorted((ROOT / "scenarios" / "paper").glob("*.yaml"))
    with ProcessPoolExecutor(2, multiprocessing.get_context("spawn")) as executor:
        rows = {one.row: one for one in executor.map(drive, files)}
    ordered = [rows[row.scenario] for row in paper_rows()]
    laps = [one for one in ordered if not one.figures]
    manoeuvres = [one for one in ordered if one.figures]
    alike = groupby(manoeuvres, lambda one: tuple(one.figures))
    values = {
        "laps": table(("row", "driving, s"), [[one.row, f"{one.simulated_s:.1f}"] for one in laps]),
        "manoeuvres": "\n".join(kind_table(names, found) for names, found in alike),
        "driven_s": f"{sum(one.simulated_s for one in ordered):.0f}",
    }
    fill(PAGE, values)


def kind_table(names: Iterable[str], rows: Iterable[Driven]) -> str:
    """Return a table of the manoeuvres that have these figures."""
    from cosim.metrics import unit_of
    from cosim.tables import MANOEUVRE_NAMES

    heads = [f"{MANOEUVRE_NAMES[name].lower()}, {unit_of(name)}" for name in names]
    lines = []
    for row in rows:
        grip = " ".join(f"{peak:.0f}" for peak in row.grip)
        values = [f"{v:.{3 if unit_of(n) == 'm' else 2}f}" for n, v in row.figures.items()]
        lines.append([row.row, *values, grip, f"{row.simulated_s:.1f}"])
    return table(["row", *heads, "grip", "driving, s"], lines)


if __name__ == "__main__":
    main()
