"""The body of `cosim check`: several files, one exit code."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from cosim.check.checker import check
from cosim.check.show import show
from cosim.errors import CosimError, did_you_mean


def run(paths: Sequence[Path], as_json: bool, static: bool, timeout: float) -> int:
    """Check every file, print the reports, return the exit code: the worst of all files.

    A file that cannot be read does not keep the others from being checked. `timeout` is how long
    one call of an FMU may take [s].
    """
    code, reports = 0, []
    for path in paths:
        try:
            report = check(path, static, timeout)
        except CosimError as error:
            hint = _nearest(path)
            print(f"error: {error}{hint}", file=sys.stderr)
            reports.append({"file": str(path), "error": f"{error}{hint}"})
            code = max(code, error.exit_code)
            continue
        reports.append(report.as_json())
        code = max(code, report.exit_code)
        if not as_json:
            show(report, sys.stdout)
    if as_json:
        print(json.dumps(reports, indent=2, ensure_ascii=False))
    return code


def _nearest(path: Path) -> str:
    if path.exists() or not path.parent.is_dir():
        return ""
    return did_you_mean(path.name, [file.name for file in path.parent.glob("*.fmu")])
