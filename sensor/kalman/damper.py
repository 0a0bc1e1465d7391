"""Force of the adjustable dampers at the wheels, as the filter knows it.

The car's tables of force over extension speed, joined by monotone cubics (Fritsch & Butland, SIAM
J. Sci. Stat. Comput. 5, 1984). A valve follows the command with a lag; the force lies between the
soft curve (0), the passive one (`PASSIVE_COMMAND`) and the hard one (1).
"""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from sensor.channels import PASSIVE_COMMAND, SAMPLE_RATE_HZ

Array = npt.NDArray[np.float64]
_SPEEDS = (0.05, 0.1, 0.25, 0.5, 1.0, 2.0)  # m/s


@dataclass(frozen=True)
class DamperMap:
    """Tables of a front wheel: force [N] in extension and in compression at 0.05, 0.1, 0.25, 0.5,
    1 (and 2) m/s; `scale` per wheel, FL FR RL RR; `lag` of the valve [s].
    """

    soft: tuple[tuple[float, ...], tuple[float, ...]] = (
        (110.0, 190.0, 330.0, 560.0, 1000.0),
        (65.0, 120.0, 230.0, 380.0, 650.0),
    )
    passive: tuple[tuple[float, ...], tuple[float, ...]] = (
        (330.0, 560.0, 950.0, 1500.0, 2500.0, 4500.0),
        (190.0, 330.0, 600.0, 900.0, 1450.0, 2300.0),
    )
    hard: tuple[tuple[float, ...], tuple[float, ...]] = (
        (900.0, 1500.0, 2350.0, 3300.0, 4900.0),
        (520.0, 900.0, 1550.0, 2150.0, 3000.0),
    )
    scale: tuple[float, float, float, float] = (1.0, 1.0, 1.33, 1.33)
    lag: float = 0.012


class Curve:
    """Force over extension speed: `force(v)` [N] at v [m/s], straight beyond the table."""

    def __init__(self, rebound: tuple[float, ...], compression: tuple[float, ...]) -> None:
        x = [*(-v for v in reversed(_SPEEDS[: len(rebound)])), 0.0, *_SPEEDS[: len(rebound)]]
        y = [*(-f for f in reversed(compression)), 0.0, *rebound]
        secant = [(y[k + 1] - y[k]) / (x[k + 1] - x[k]) for k in range(len(x) - 1)]
        slope = [secant[0], *(_slope(x, secant, k) for k in range(1, len(x) - 1)), secant[-1]]
        self._x = x
        pieces = [(x[0], y[0], slope[0], 0.0, 0.0)]
        for k, s in enumerate(secant):
            h, (a, b) = x[k + 1] - x[k], slope[k : k + 2]
            pieces.append((x[k], y[k], a, (3 * s - 2 * a - b) / h, (a + b - 2 * s) / (h * h)))
        self._pieces = [*pieces, (x[-1], y[-1], slope[-1], 0.0, 0.0)]

    def force(self, v: float) -> tuple[float, float]:
        """Return the force [N] at extension speed v [m/s] and its slope [N s/m]."""
        x, y, b, c, d = self._pieces[bisect_right(self._x, v)]
        t = v - x
        return y + t * (b + t * (c + t * d)), b + t * (2.0 * c + 3.0 * t * d)


def _slope(x: list[float], secant: list[float], k: int) -> float:
    """Weighted harmonic mean of the neighbouring secants."""
    h0, h1 = x[k] - x[k - 1], x[k + 1] - x[k]
    w0, w1 = 2 * h1 + h0, h1 + 2 * h0
    return (w0 + w1) / (w0 / secant[k - 1] + w1 / secant[k])


class Dampers:
    """The four dampers with their valves: `set` once a sample, then `force`."""

    def __init__(self, damper: DamperMap | None = None, rate: float = SAMPLE_RATE_HZ) -> None:
        d = damper or DamperMap()
        self._curves = [Curve(*table).force for table in (d.soft, d.passive, d.hard)]
        self._scale = d.scale
        self._share = 1.0 - float(np.exp(-1.0 / (rate * d.lag)))
        self.reset()

    def reset(self) -> None:
        """Forget the valves; the next command counts as having been held forever."""
        self._valve = [PASSIVE_COMMAND] * 4
        self._started = False
        self.valve = PASSIVE_COMMAND  # mean of the four

    def set(self, command: Array) -> None:
        """Let the valves follow `command` (4,), 0 soft to 1 hard, for one sample."""
        wanted = command.tolist()
        if not self._started:
            self._valve, self._started = wanted, True
        for i, value in enumerate(wanted):
            self._valve[i] += self._share * (value - self._valve[i])
        self.valve = min(max(sum(self._valve) / len(wanted), 0.0), 1.0)

    def force(self, wheel: int, v: float) -> tuple[float, float]:
        """Return the force [N] against a wheel's extension at v [m/s], and its slope [N s/m]."""
        soft, passive, hard = self._curves
        valve, scale = self._valve[wheel], self._scale[wheel]
        other, share = soft, 1.0 - valve / PASSIVE_COMMAND
        if valve > PASSIVE_COMMAND:
            other, share = hard, (valve - PASSIVE_COMMAND) / (1.0 - PASSIVE_COMMAND)
        force, slope = passive(v)
        if share > 0.0:
            end = other(v)
            force += share * (end[0] - force)
            slope += share * (end[1] - slope)
        return scale * force, scale * slope


def equivalent_damping(
    deviation: float, kind: str = "passive", damper: DamperMap | None = None
) -> Array:
    """Return the slope (4,) [N s/m] at the wheels that fits a curve, "soft", "passive" or "hard",
    best in the least squares to a normally distributed extension speed of this deviation [m/s]
    (statistical linearisation).
    """
    d = damper or DamperMap()
    curve = Curve(*{"soft": d.soft, "passive": d.passive, "hard": d.hard}[kind])
    v = np.linspace(-5.0, 5.0, 1001) * deviation
    weight = np.exp(-0.5 * np.square(v / deviation))
    force = np.array([curve.force(x)[0] for x in v.tolist()])
    return np.array(d.scale) * float((weight * force * v).sum() / (weight * v * v).sum())
