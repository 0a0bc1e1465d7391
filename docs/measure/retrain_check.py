"""Does retraining give the same network? `make retrain-check` trains every shipped network again
with another seed and compares the errors on the runs held out.

    python docs/measure/retrain_check.py --data data [--only carried_ideal] [--seed 2]

Exit code 1 if one differs by more than `SPREAD` from the committed record. As long as a training:
about half an hour of one core for each network; stopped and started again, it goes on.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from sensor.families import Training, train

ROOT = Path(__file__).parents[2]
SPREAD = 0.05  # relative; seeds of one recipe lie closer (docs/carried-study.md)
RECIPES = {
    "carried_ideal": "carried_ideal.yaml",
    "carried_production": "carried_production.yaml",
    "bilstm_w19_ideal": "paper.yaml",
    "bilstm_residual_w19_ideal": "bilstm_residual_w19_ideal.yaml",
    "bilstm_residual_w19_production": "bilstm_residual_w19_production.yaml",
}


def error_of(record: Path) -> float:
    """Return the least error in validation of a training record, in the unit of its family."""
    content = json.loads(record.read_text("utf-8"))
    return float(content.get("best_validation_rmse", content.get("best_validation_error")))


def data_of(name: str) -> tuple[str, ...]:
    """Return the data sets that a network is trained on."""
    if name.startswith("carried"):
        return "own", "harder"
    return ("paper",) if name == "bilstm_w19_ideal" else ("own",)


def main() -> None:
    """Train, compare, and tell."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=ROOT / "data")
    parser.add_argument("--only", choices=RECIPES)
    parser.add_argument("--seed", type=int, default=2)
    given = parser.parse_args()
    failed = False
    for name in [given.only] if given.only else RECIPES:
        out = ROOT / "build" / "retrained" / f"{name}_seed{given.seed}"
        data = tuple(given.data / one for one in data_of(name))
        recipe = ROOT / "sensor" / "recipes" / RECIPES[name]
        train(Training(recipe, data, out, resume=True, seed=given.seed))
        shipped = error_of(ROOT / "sensor" / "models" / f"{name}.json")
        again = error_of(out / "training.json")
        agrees = abs(again / shipped - 1.0) <= SPREAD
        failed |= not agrees
        print(
            f"{name}: shipped {shipped:.5g}, seed {given.seed} {again:.5g}, "
            f"{100 * (again / shipped - 1):+.1f} %: {'agrees' if agrees else 'DIFFERS'}"
        )
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
