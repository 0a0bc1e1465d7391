"""Estimators that the network has to beat: nothing, the body's own motion, and a linear filter."""

from sensor.baselines.fir import FirFilter
from sensor.baselines.still_wheels import StillWheels
from sensor.baselines.zero import Zero

__all__ = ["FirFilter", "StillWheels", "Zero"]
