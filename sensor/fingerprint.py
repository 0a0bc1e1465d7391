"""What an estimator's figures depend on, as a digest: as long as it is the same, so are they."""

import hashlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from sensor.conditions import CONDITIONS, Condition
from sensor.errors import SensorError
from sensor.estimators import model_file, names
from sensor.provenance import versions

_PACKAGE = Path(__file__).parent
_ENDINGS = (".py", ".npz", ".onnx")


def digest(path: Path) -> str:
    """Return a file's SHA-256 in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def fingerprint(name: str, condition: Condition) -> str:
    """Return the digest of an estimator's model file and of all that estimators have in common:
    this package's sources and data, and the versions of what it stands on.

    Raises SensorError for an unknown name, or a model file that is not there.
    """
    own = model_file(name, condition)
    parts = [_common(), name, condition, digest(own) if own else ""]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


@cache
def _common() -> str:
    models = set(_models())
    files = sorted(
        path for path in _PACKAGE.rglob("*") if path.suffix in _ENDINGS and path not in models
    )
    packages = [f"{name} {version}" for name, version in versions().items() if name != "commit"]
    parts = [f"{path.relative_to(_PACKAGE)} {digest(path)}" for path in files]
    return hashlib.sha256("\n".join([*packages, *parts]).encode()).hexdigest()


def _models() -> Iterator[Path]:
    """Yield the model files of all estimators, so that a new one of one spoils no other's."""
    for name in names():
        for condition in CONDITIONS:
            try:
                path = model_file(name, condition)
            except SensorError:
                continue
            if path is not None:
                yield path
