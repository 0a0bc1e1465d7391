"""The folder of a scenario's results: made ready, and the files in it that are text."""

from __future__ import annotations

import io
import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from cosim import black_box
from cosim.errors import InputError
from cosim.recorder import require_parquet
from cosim.scenario.schema import Scenario

RESOLVED: Final = "scenario.resolved.yaml"
RESULT_FILES: Final = (
    "signals.csv",
    "signals.parquet",
    black_box.NAME,
    "metrics.json",
    RESOLVED,
    "versions.json",
    "report.html",
)


def prepare(output_dir: Path, scenario: Scenario) -> None:
    """Make the folder, and take away what an earlier run left there; raises `InputError`."""
    if scenario.output.format == "parquet":
        require_parquet()
    try:
        output_dir.mkdir(parents=True, exist_ok=True)
        for folder in (output_dir, *(path for path in output_dir.iterdir() if path.is_dir())):
            left = [folder / name for name in RESULT_FILES if (folder / name).is_file()]
            for path in left:
                path.unlink()
            if left and folder != output_dir and not any(folder.iterdir()):
                folder.rmdir()
        (output_dir / RESOLVED).write_text(resolved_yaml(scenario), encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write to '{output_dir}': {error.strerror or error}") from None


def folder_of(scenario: Scenario, output_dir: Path, label: str) -> Path:
    """Return the folder of one run: that of the results where there is but one."""
    return output_dir if len(scenario.controllers) == 1 else output_dir / label


def finite(value: Any) -> Any:
    """Return `value` with every number that JSON cannot carry (NaN, infinities) as None."""
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def resolved_yaml(scenario: Scenario) -> str:
    """Return the scenario with every default and override filled in, variants as parameters and
    absolute paths, as YAML.
    """
    from ruamel.yaml import YAML

    data = scenario.model_dump(mode="json", by_alias=True, exclude_none=True)
    if scenario.road.file is not None:
        data["road"]["file"] = str(scenario.resolve(scenario.road.file).resolve())
        del data["road"]["surface"], data["road"]["obstacles"]
    data["vehicle"]["parameters"] = scenario.parameters
    del data["vehicle"]["variants"]
    if scenario.vehicle.fmu != "builtin":
        data["vehicle"]["fmu"] = str(scenario.resolve(scenario.vehicle.fmu).resolve())
        del data["vehicle"]["fmi_version"]
    for part in (data["sensor"], *data["controllers"]):
        for kind in {"network", "fmu", "file"} & part.keys():
            part[kind] = str(scenario.resolve(part[kind]).resolve())
    for own, controller in zip(data["controllers"], scenario.controllers, strict=True):
        if getattr(controller, "fallback", None) is not None:
            del own["initial_command"]
    for fault in data["faults"]:
        if "file" in fault:
            fault["file"] = str(scenario.resolve(fault["file"]).resolve())
    yaml = YAML()
    yaml.width = 100
    stream = io.StringIO()
    yaml.dump(data, stream)
    return stream.getvalue()


def write_json(path: Path, value: Any) -> None:
    """Write a JSON file; raises `ValueError` for a number that JSON cannot carry."""
    path.write_text(
        json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False) + "\n", "utf-8"
    )
