"""Write a network's model card: what it is, how it was trained, what it reaches on each row, where
it must not be trusted.

`python -m sensor.model_card --model M.onnx --training training.json --figures figures.json` writes
M.md beside the model. The figures are a JSON list of rows, each {"scenario": name in Table 4,
"condition": "smooth", "figures": {estimator: Metrics.to_dict()}}; `figure_row` makes one.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from sensor.channels import CHANNELS
from sensor.metrics import LEAST_TRUTH_RMS, Metrics
from sensor.paper import PaperRow, paper_rows

_LIMITS = f"""\
- Trained on simulated runs of one vehicle with ideal channels: no noise, offset or delay. It has
  seen no real car.
- The damper settings of the training runs are the only ones it knows; with others its error grows.
- The four corner forces are not determined by the body's motion alone: the warp mode (front left
  and rear right against the other two) is known only through wheel speeds and the wheelbase delay.
- Accuracy means nothing where the truth hardly moves; rows with a truth below
  {1e3 * LEAST_TRUTH_RMS:.0f} mm/s rms are marked and only their RMSE counts.
- The paper's figures come from another simulator, vehicle model and set of roads; they stand
  beside for orientation.
"""


def figure_row(scenario: str, condition: str, figures: Mapping[str, Metrics]) -> dict[str, Any]:
    """Return one row of the figures file: Table 4 scenario, condition, metrics by estimator."""
    by_name = {name: metrics.to_dict() for name, metrics in figures.items()}
    return {"scenario": scenario, "condition": condition, "figures": by_name}


def model_card(name: str, training: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> str:
    """Return the card as Markdown from the training record and the rows of figures."""
    parts = [
        f"# {name}\n\n{_introduction(training)}",
        f"## Training\n\n{_training(training)}",
        f"## Data\n\n{_data(training['samples'])}",
        f"## Figures\n\n{_figures(rows)}",
        f"## Limits\n\n{_LIMITS}",
    ]
    return "\n\n".join(part.rstrip() for part in parts) + "\n"


def _introduction(training: Mapping[str, Any]) -> str:
    network = training["recipe"]["network"]
    return (
        f"Virtual sensor for the four suspension velocities [m/s], positive in extension, from the "
        f"last {network['window']} samples of {len(CHANNELS)} channels: one bidirectional LSTM "
        f"layer of {network['units']} units per direction, its output at the last sample, a dense "
        f"layer of {network['hidden']}, four outputs."
    )


def _training(training: Mapping[str, Any]) -> str:
    recipe, epochs = training["recipe"], training["epochs"]
    settings = recipe["training"]
    lines = [
        ("recipe", recipe["name"]),
        ("seed", recipe["seed"]),
        ("optimiser", f"Adam, learning rate {settings['learning_rate']:g}, {settings['schedule']}"),
        ("epochs", f"{len(epochs)}, best in validation {training['best_epoch']}"),
        ("windows per epoch", settings["windows_per_epoch"] or "all"),
        ("batch, precision", f"{settings['batch_size']}, {settings['precision']}"),
        ("validation RMSE", f"{1e3 * training['best_validation_rmse']:.2f} mm/s"),
        ("duration", f"{sum(epoch['seconds'] for epoch in epochs) / 60.0:.0f} min"),
        *sorted(training["versions"].items()),
    ]
    return _table(("", ""), [(key, str(value)) for key, value in lines])


def _data(samples: Mapping[str, Mapping[str, int]]) -> str:
    rows = [
        (run, part, str(count)) for part, runs in samples.items() for run, count in runs.items()
    ]
    return _table(("run", "part", "samples at 100 Hz"), rows)


def _figures(rows: Sequence[Mapping[str, Any]]) -> str:
    """One line per scenario and condition: each estimator's figures, the paper's beside."""
    if not rows:
        return "None yet."
    printed = {row.scenario: row for row in paper_rows()}
    estimators = list(dict.fromkeys(name for row in rows for name in row["figures"]))
    header = ("scenario", "condition", "truth rms, mm/s", *estimators, "paper")
    body = [
        (
            row["scenario"],
            row["condition"],
            _truth(row["figures"]),
            *(_cell(row["figures"].get(name)) for name in estimators),
            _paper_cell(printed.get(row["scenario"])),
        )
        for row in rows
    ]
    note = "RMSE over all wheels in mm/s; accuracy in %, in brackets where it means nothing."
    return f"{note}\n\n{_table(header, body)}"


def _truth(figures: Mapping[str, Mapping[str, Any]]) -> str:
    first: Mapping[str, Any] = next(iter(figures.values()))
    return f"{1e3 * first['overall']['truth_rms']:.1f}"


def _cell(metrics: Mapping[str, Any] | None) -> str:
    if metrics is None:
        return "-"
    overall, meaningful = metrics["overall"], metrics["overall"]["accuracy_meaningful"]
    if overall["accuracy"] is None:
        return f"{1e3 * overall['rmse']:.2f}"
    shown = f"{overall['accuracy']:.1f}" if meaningful else f"({overall['accuracy']:.1f})"
    return f"{1e3 * overall['rmse']:.2f}; {shown}"


def _paper_cell(row: PaperRow | None) -> str:
    return "-" if row is None else f"{1e3 * row.rmse_overall:.1f}; {row.accuracy:.1f}"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


@click.command(help=__doc__)
@click.option("--model", required=True, type=click.Path(path_type=Path), help="The network (ONNX).")
@click.option("--training", required=True, type=click.Path(exists=True, path_type=Path))
@click.option(
    "--figures", type=click.Path(exists=True, path_type=Path), help="Figures by row (JSON)."
)
def main(model: Path, training: Path, figures: Path | None) -> None:
    """Write the card beside the model."""
    record = json.loads(training.read_text(encoding="utf-8"))
    rows = json.loads(figures.read_text(encoding="utf-8")) if figures else []
    model.with_suffix(".md").write_text(model_card(model.stem, record, rows), encoding="utf-8")


if __name__ == "__main__":
    main()
