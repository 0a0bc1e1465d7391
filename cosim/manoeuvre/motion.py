"""The motion of a car as recorded, in the quantities that the figures of a manoeuvre need."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.recorder import Recorder

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Motion:
    """Signals over time, all (rows,): time [s], place x and y of the reference point [m], yaw
    [rad], forward speed vx [m/s], lateral acceleration ay [m/s2], yaw rate [rad/s], steering-wheel
    angle [rad], positive to the left; axes ISO 8855.
    """

    time: Array
    x: Array
    y: Array
    yaw: Array
    vx: Array
    ay: Array
    yaw_rate: Array
    steering_wheel: Array

    @property
    def travelled(self) -> Array:
        """Distance travelled since the first row [m]."""
        steps = np.hypot(np.diff(self.x), np.diff(self.y))
        return np.concatenate(([0.0], np.cumsum(steps)))

    @property
    def side_slip(self) -> Array:
        """Side slip angle of the reference point [rad]: course less yaw, 0 while standing."""
        if len(self.x) < 2:
            return np.zeros_like(self.x)
        vx, vy = np.gradient(self.x), np.gradient(self.y)
        angle = np.angle((vx + 1j * vy) * np.exp(-1j * self.yaw))
        return np.where(np.hypot(vx, vy) > 1e-3, angle, 0.0)


def motion_of(recorder: Recorder) -> Motion:
    """Return the true motion of a record with the groups channels and vehicle."""
    pose = recorder.columns(("Car.tx", "Car.ty", "Car.Yaw"))
    channels = recorder.car_channels(("Car.vx", "Car.ay", "Car.YawRate", "Steer.WhlAng"))
    return Motion(recorder.time, *pose.T, *channels.T)
