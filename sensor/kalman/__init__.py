"""Kalman filters for the suspension velocities at run time; `cosim.kalman` designs them."""

from sensor.kalman.filter import KalmanFilter
from sensor.kalman.model import KalmanModel
from sensor.kalman.smoother import Smoother

__all__ = ["KalmanFilter", "KalmanModel", "Smoother"]
