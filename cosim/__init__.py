"""Co-simulation of a vehicle FMU, a virtual suspension-velocity sensor and damper controllers."""

from importlib import metadata

try:
    __version__ = metadata.version("suspension-cosim")
except metadata.PackageNotFoundError:  # run from a checkout that was not installed
    __version__ = "0+unknown"
