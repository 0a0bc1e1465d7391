"""Motion of the body at its four corners, from the IMU channels alone.

Rigid body: the corner at (x, y) from the centre of gravity moves upward with v = v_z + y dphi/dt -
x dtheta/dt (phi roll, theta pitch, positive nose down; ISO 8855).

What an IMU says is turned with the car. Upward acceleration is a_z + phi a_y - theta a_x, and the
angles change with dphi/dt = p + theta r and dtheta/dt = q - phi r: in a bend at 8 m/s2 a body that
leans by 5 degrees accelerates upward by 0.7 m/s2 less than its a_z says, and its gyroscope reports
a pitching that is only yaw. The angles are those which the suspension takes under the accelerations
(`Lean`); they carry the leaning of the body in bends and while braking, not the road's.

Nothing of an offset may stay. v_z is a_z through s / (s^2 + sqrt(2) w s + w^2), an integral and the
Butterworth high-pass at once: it leaves nothing of a constant acceleration, be it an offset or a
grade. The angles' rates pass a high-pass of first order. Corner frequencies are a compromise of
phase lead at the body's resonance (13 degrees at 1.2 Hz) with what crests and hollows of the road
leave: docs/closed-loop.md. The acceleration is the same signal one derivative further; what has to
be differentiated for it, the angles' rates, through a lag that keeps the gyroscopes' noise low.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt

import numpy as np
import numpy.typing as npt

from cosim.control.biquad import Biquad
from sensor.body_motion import Geometry
from sensor.channels import CHANNEL_NAMES

Array = npt.NDArray[np.float64]

_AX, _AY, _AZ, _P, _Q, _R = (
    CHANNEL_NAMES.index(f"Car.{name}")
    for name in ("ax", "ay", "az", "RollVel", "PitchVel", "YawRate")
)


@dataclass(frozen=True)
class Lean:
    """Roll angle per lateral and pitch angle per longitudinal acceleration [rad per m/s2]; what the
    vehicle FMU has in bends and while braking (docs/closed-loop.md), behind a lag of `corner_hz`.
    """

    roll: float = 0.011
    pitch: float = -0.0055
    corner_hz: float = 2.0


@dataclass(frozen=True)
class Corners:
    """Corner frequencies [Hz]: high-passes of heave, and of roll and pitch, and the lag of the
    angular accelerations.
    """

    heave_hz: float = 0.2
    angles_hz: float = 0.05
    angular_acceleration_hz: float = 15.0


class Body:
    """Streaming estimator of the body's motion.

    `modes` (3,) are heave velocity [m/s], positive upward, and roll and pitch rate [rad/s];
    `velocity` (4,) [m/s] and `acceleration` (4,) [m/s2] those of the corners, positive upward,
    order FL FR RL RR. The same arrays at every step.
    """

    def __init__(
        self,
        geometry: Geometry | None = None,
        lean: Lean | None = None,
        corners: Corners | None = None,
    ) -> None:
        self.mixing = (geometry or Geometry()).mixing()
        self._lean = lean or Lean()
        self.modes, self.velocity, self.acceleration = np.zeros(3), np.zeros(4), np.zeros(4)
        self._derivatives = np.zeros(3)
        self._make_filters(corners or Corners())
        self._started = False

    def _make_filters(self, corners: Corners) -> None:
        w, angles = 2 * pi * corners.heave_hz, 2 * pi * corners.angles_hz
        lag, lean = 2 * pi * corners.angular_acceleration_hz, 2 * pi * self._lean.corner_hz
        heave = (1.0, sqrt(2) * w, w * w)
        lagged = (1.0, angles + lag, angles * lag)
        self._roll_angle, self._pitch_angle = (
            Biquad((0.0, 0.0, lean), (0.0, 1.0, lean)) for _ in range(2)
        )
        self._velocities = (
            Biquad((0.0, 1.0, 0.0), heave),
            *(Biquad((0.0, 1.0, 0.0), (0.0, 1.0, angles)) for _ in range(2)),
        )
        self._accelerations = (
            Biquad((1.0, 0.0, 0.0), heave),
            *(Biquad((lag, 0.0, 0.0), lagged) for _ in range(2)),
        )

    def step(self, measured: Array) -> None:
        """Take one sample (14,) in SI units; the first counts as having lasted for ever."""
        ax, ay, az = float(measured[_AX]), float(measured[_AY]), float(measured[_AZ])
        p, q, r = float(measured[_P]), float(measured[_Q]), float(measured[_R])
        lateral, longitudinal = self._lean.roll * ay, self._lean.pitch * ax
        if not self._started:
            self._roll_angle.settle(lateral)
            self._pitch_angle.settle(longitudinal)
        roll, pitch = self._roll_angle.step(lateral), self._pitch_angle.step(longitudinal)
        rates = (az + roll * ay - pitch * ax, p + pitch * r, q - roll * r)
        for i, rate in enumerate(rates):
            if not self._started:
                self._velocities[i].settle(rate)
                self._accelerations[i].settle(rate)
            self.modes[i] = self._velocities[i].step(rate)
            self._derivatives[i] = self._accelerations[i].step(rate)
        self._started = True
        np.matmul(self.mixing, self.modes, out=self.velocity)
        np.matmul(self.mixing, self._derivatives, out=self.acceleration)
