"""Compiles the FMUs, package data of ``cosim``, while a wheel or editable install is built."""

import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class FmuBuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Runs ``fmu/build.py``; the wheel then belongs to a platform, but to every Python 3."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build into ``cosim/fmus`` and add the result, although git ignores it."""
        if self.target_name != "wheel":
            return
        command = [sys.executable, str(Path(self.root, "fmu", "build.py"))]
        result = subprocess.run(command, check=False)
        if result.returncode != 0:
            raise SystemExit(result.returncode)  # the build has said why
        build_data["artifacts"] += ["/cosim/fmus/*.fmu", "/cosim/fmus/*.so"]
        build_data["pure_python"] = False
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["tag"] = f"py3-none-{platform}"
