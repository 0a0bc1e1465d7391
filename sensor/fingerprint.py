"""What an estimator's figures depend on, as a digest: as long as it is the same, so are they."""

import ast
import hashlib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Final

from sensor import conditions, estimators, evaluation
from sensor.conditions import Condition
from sensor.estimators import make, model_file
from sensor.provenance import versions

_PACKAGE: Final = __name__.partition(".")[0]
_JUDGED: Final[tuple[ModuleType, ...]] = (evaluation, conditions)
_CHOOSES: Final = estimators.__name__  # imports every estimator, each only where it is made


def digest(path: Path) -> str:
    """Return a file's SHA-256 in hexadecimal."""
    return hashlib.sha256(path.read_bytes()).hexdigest()


def fingerprint(name: str, condition: Condition) -> str:
    """Return the digest of an estimator's model file, of the sources that it and its evaluation
    import from this package, directly or not, and of the versions of what they stand on.

    Raises SensorError for an unknown name, or a model file that is not there.
    """
    own = model_file(name, condition)
    packages = [f"{name} {version}" for name, version in versions().items() if name != "commit"]
    files = [f"{module} {digest(path)}" for module, path in sources(name, condition).items()]
    parts = [name, condition, digest(own) if own else "", *packages, *files]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def sources(name: str, condition: Condition) -> Mapping[str, Path]:
    """Return the modules of this package that an estimator's figures depend on, with their files.

    Raises SensorError as `fingerprint` does.
    """
    judged = (module.__name__ for module in _JUDGED)
    return _closure((*judged, type(make(name, condition)).__module__))


@cache
def _closure(roots: tuple[str, ...]) -> Mapping[str, Path]:
    """Return the files of these modules, and of all that they import from here, by name."""
    found: dict[str, Path] = {}
    open_modules = list(roots)
    while open_modules:
        module = open_modules.pop()
        spec = find_spec(module) if module not in found else None
        if spec is None or spec.origin is None:
            continue
        found[module] = Path(spec.origin)
        open_modules += _imported(module, Path(spec.origin))
    return dict(sorted(found.items()))


def _imported(module: str, file: Path) -> Iterator[str]:
    """Yield the modules of this package that a file imports; of the module that chooses among the
    estimators only what it imports at once.
    """
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in tree.body if module == _CHOOSES else ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == _PACKAGE:
            yield str(node.module)
            named = (f"{node.module}.{alias.name}" for alias in node.names)
            yield from (name for name in named if _is_module(name))
        elif isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name.split(".")[0] == _PACKAGE)


def _is_module(name: str) -> bool:
    try:
        return find_spec(name) is not None
    except ModuleNotFoundError:  # what it would lie in is no package
        return False
