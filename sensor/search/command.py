"""The search as one command: the missing trials, then durations, table and JSON."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from sensor.errors import SensorError
from sensor.recipe import read_search_recipe
from sensor.search.results import results
from sensor.search.run import STORAGE, open_studies, search
from sensor.search.study import finished


@dataclass(frozen=True)
class Budget:
    """Processes for the trials (0: no trials) and samples for the durations."""

    jobs: int
    samples: int


def run(recipe_path: Path, data: Path, out: Path, budget: Budget) -> None:
    """Do the missing trials in `out`, print the table of the best networks and write
    `search.json`.

    Raises SensorError if recipe or data do not fit, or if there is not one finished trial.
    """
    recipe = read_search_recipe(recipe_path)
    if budget.jobs:
        search(recipe, data, out, jobs=budget.jobs)
    elif not (out / STORAGE).is_file():
        raise SensorError(f"{out}: there is no search ({STORAGE}) to summarise.")
    studies = open_studies(recipe, out)
    if not any(finished(study) for study in studies.values()):
        raise SensorError(f"{out}: the search has no finished trial yet.")
    found = results(recipe, studies, budget.samples)
    path = out / "search.json"
    path.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    console = Console(stderr=True)
    console.print(_table(found))
    console.print(f"results in {path}", highlight=False)


def _table(found: dict[str, Any]) -> Table:
    """Table 3: the best network of each window."""
    table = Table()
    for head in ("window", "trials", "LSTM", "dense", "RMSE, mm/s", "%", "us a sample", "%"):
        table.add_column(head, justify="right")
    for row in found["windows"]:
        table.add_row(
            str(row["window"]),
            str(len(row["trials"])),
            str(row["units"]),
            str(row["hidden"]),
            f"{1e3 * row['rmse']:.2f}",
            f"{row['relative_error_percent']:.1f}",
            f"{1e6 * row['duration_s']:.0f}",
            f"{row['relative_duration_percent']:.1f}",
        )
    return table
