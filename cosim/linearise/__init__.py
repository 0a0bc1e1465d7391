"""The vehicle FMU as a linear system, found through its FMI interface."""

from cosim.linearise.fmu import linearise
from cosim.linearise.model import LinearModel
from cosim.linearise.road import linearise_on_road

__all__ = ["LinearModel", "linearise", "linearise_on_road"]
