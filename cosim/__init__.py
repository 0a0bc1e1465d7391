"""Co-simulation of a vehicle FMU, a virtual suspension-velocity sensor and damper controllers."""

from typing import Any


def __getattr__(name: str) -> Any:
    """Return `__version__`; looked up when it is asked for, since that takes 50 ms."""
    if name != "__version__":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import metadata

    try:
        return metadata.version("suspension-cosim")
    except metadata.PackageNotFoundError:  # run from a checkout that was not installed
        return "0+unknown"
