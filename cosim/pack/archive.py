"""Writing an FMU: the same files give the same bytes, and the FMU appears whole or not at all."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Final

ZIP_TIME: Final = (1980, 1, 1, 0, 0, 0)


def write_fmu(path: Path, files: Mapping[str, bytes], compressed: bool = True) -> None:
    """Write the files by their path in the FMU; raises OSError."""
    method = zipfile.ZIP_DEFLATED if compressed else zipfile.ZIP_STORED
    with zipfile.ZipFile(path, "w", method, compresslevel=6) as archive:
        for name in sorted(files):
            entry = zipfile.ZipInfo(name, ZIP_TIME)
            # weights are noise to a compressor: a tenth smaller, for most of the time it takes
            entry.compress_type = zipfile.ZIP_STORED if name.endswith(".bin") else method
            entry.create_system = 3  # Unix, wherever this runs
            entry.external_attr = (0o755 if name.startswith("binaries/") else 0o644) << 16
            archive.writestr(entry, files[name])
