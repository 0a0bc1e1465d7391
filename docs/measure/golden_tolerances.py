"""How much of their tolerances the shipped goldens use: the table of docs/regression.md.

`python docs/measure/golden_tolerances.py` runs each shipped scenario that has goldens three times:
as it is; with its network in C, which rounds as little like ONNX Runtime as another processor's
instructions would; and with a car 1 % heavier, which the goldens should not let pass. Some four
minutes.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from markdown_tables import table

from cosim.batch import Job, find_scenarios, run_all
from cosim.pack.command import run as pack
from cosim.scenario.load import load
from cosim.scenario.schema import Scenario
from sensor.conditions import CONDITIONS, Condition
from sensor.estimators import model_file

SCENARIOS: Final = Path(__file__).parents[2] / "scenarios"
MASS_KG: Final = 1.01 * 2442.0  # of the whole vehicle
PROCESSES: Final = 2
# Runs whose controllers name their estimators, or whose sensor is behind a bus.
RUNS: Final = {
    "closed_loop_class_c_50": "{kind: cautious_skyhook, name: cautious_skyhook_carried, %s}",
    "bus_class_c_50": "{kind: skyhook, name: direct, %s}",
}

Overrides = tuple[tuple[str, str], ...]


def main() -> None:
    """Print the table."""
    files = [file for file in find_scenarios([SCENARIOS])[0] if load(file).goldens]
    with tempfile.TemporaryDirectory() as folder:
        fmus = {one: packed(Path(folder), one) for one in CONDITIONS}
        scenarios = {file: load(file) for file in files}
        kinds = (
            {file: labelled() for file in files},
            {file: labelled(*in_c(one, fmus)) for file, one in scenarios.items()},
            {file: labelled(f"vehicle.parameters.Body.Mass={MASS_KG:g}") for file in files},
        )
        shares = [used(kind, Path(folder) / str(i)) for i, kind in enumerate(kinds)]
    rows = [
        [f"`{file.relative_to(SCENARIOS)}`", *(shown(share[file]) for share in shares)]
        for file in files
    ]
    print(table(["scenario", "as it is", "network in C", "car 1 % heavier"], rows))


def packed(folder: Path, condition: Condition) -> Path:
    """Return the default estimator's network for a measurement condition as an FMU."""
    path = folder / f"{condition}.fmu"
    network = model_file("carried", condition)
    assert network is not None
    pack(network, path, 3, ())
    return path


def in_c(scenario: Scenario, fmus: Mapping[Condition, Path]) -> Sequence[str]:
    """Return the overrides that put the FMU in the network's place."""
    condition = scenario.sensor.condition
    run = RUNS.get(Path(str(scenario.file)).stem)
    if run is None:
        return (f"sensor={{fmu: {fmus[condition]}, condition: {condition}}}",)
    controller = run % f"fmu: {fmus[condition]}"
    return ("limits=[]", "sensor={estimator: zero}", f"controllers=[{controller}]")


def labelled(*overrides: str) -> Overrides:
    """Return overrides with what messages call them."""
    return tuple((text, f"--set {text}") for text in overrides)


def used(overrides: Mapping[Path, Overrides], folder: Path) -> dict[Path, float]:
    """Return the largest share of its tolerance that a golden of each scenario uses."""
    jobs = [Job(file, folder / file.stem, given, "compare") for file, given in overrides.items()]
    ended, _ = run_all(jobs, PROCESSES)
    shares = {}
    for one in ended:
        if one.metrics is None:
            raise SystemExit("\n".join(one.problems))
        found = [
            limit["value"] / limit["max"]
            for limit in one.metrics["limits"]
            if limit["metric"].startswith("distance of ") and limit["value"] is not None
        ]
        shares[one.job.scenario] = max(found)
    return shares


def shown(share: float) -> str:
    """Return a share of the tolerance, with two digits."""
    return f"{share:.2f}" if share < 1 else f"{share:.0f}"


if __name__ == "__main__":
    main()
