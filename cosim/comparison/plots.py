"""What the page draws: spectra, a plane of comfort over tyre load, and signals over time."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.comfort import WK, weighting_gain
from cosim.comparison.read import ComparedRun
from cosim.metrics import WHEELS, figure

Array = npt.NDArray[np.float64]

SEAT: Final = "Car.Seat.az"
LOADS: Final = tuple(f"Car.Fz{wheel}" for wheel in WHEELS)
OVER_TIME: Final = {
    SEAT: ("Vertical acceleration at the seat", "m/s²"),
    "Car.SuspControl.DamperFL.CtrlOut": ("Damper command, front left", ""),
    "Car.DampFL.Frc": ("Damper force, front left", "N"),
    "Car.DampFL.v": ("Damper velocity, front left", "m/s"),
    "Car.Roll": ("Roll angle", "rad"),
}
PLANE: Final = ("comfort.weighted_acceleration_m_s2", "comfort.tyre_load_rms_n")
BAND_HZ: Final = (0.3, 25.0)
SETTLING_S: Final = 2.0  # left out of the spectra as of the ride figures
RESOLUTION_HZ: Final = 0.25


def plots_of(runs: Sequence[ComparedRun]) -> dict[str, Any]:
    """Return what the page's script draws: `runs` (names), `plane`, `spectra` and `signals`."""
    read = [run.signals([*OVER_TIME, *LOADS]) for run in runs]
    plane = [[figure(run.figures, path) for path in PLANE] for run in runs]
    return {
        "runs": [run.name for run in runs],
        "plane": plane,
        "spectra": [
            {"title": title, "unit": unit, **_spectra(read, names, weighted)}
            for title, unit, names, weighted in (
                ("Weighted vertical acceleration at the seat (W_k)", "(m/s²)²/Hz", (SEAT,), True),
                ("Dynamic tyre load, mean of the wheels", "N²/Hz", LOADS, False),
            )
        ],
        "signals": [
            {"title": title, "unit": unit, "lines": [_line(one, name) for one in read]}
            for name, (title, unit) in OVER_TIME.items()
            if any(name in one for one in read)
        ],
    }


def spectrum(signals: Array, step_s: float, weighted: bool) -> tuple[Array, Array]:
    """Return frequencies (m,) in the band and the mean power spectral density (m,) of signals (n,
    columns), Welch's; `weighted` by W_k of ISO 2631-1.
    """
    from scipy.signal import welch

    length = min(round(1 / RESOLUTION_HZ / step_s), len(signals))
    frequency, density = welch(signals, 1 / step_s, nperseg=length, axis=0)
    inside = (frequency >= BAND_HZ[0]) & (frequency <= BAND_HZ[1])
    power = np.asarray(density.mean(axis=1)[inside], dtype=np.float64)
    if weighted:
        power = power * weighting_gain(WK, frequency[inside]) ** 2
    return np.asarray(frequency[inside], dtype=np.float64), power


def _spectra(
    read: Sequence[Mapping[str, Array]], names: Sequence[str], weighted: bool
) -> dict[str, Any]:
    """Return `frequency` and `lines` for the script, None for a run without the signals."""
    lines: list[list[float] | None] = []
    shared: list[float] = []
    for one in read:
        columns = _columns(one, names)
        if columns is None:
            lines.append(None)
            continue
        step = float(one["time"][1] - one["time"][0])
        frequency, power = spectrum(columns[round(SETTLING_S / step) :], step, weighted)
        shared = frequency.tolist()
        lines.append([float(f"{value:.4g}") for value in power])
    return {"frequency": shared, "lines": lines}


def _columns(one: Mapping[str, Array], names: Sequence[str]) -> Array | None:
    """Return the signals (n, columns) where they are all there for long enough."""
    if not {"time", *names} <= one.keys():
        return None
    columns = np.column_stack([one[name] for name in names])
    enough = len(columns) > 2 and one["time"][-1] > SETTLING_S + 2 / RESOLUTION_HZ
    return columns if enough and np.isfinite(columns).all() else None


def _line(one: Mapping[str, Array], name: str) -> dict[str, Any] | None:
    if name not in one or len(one[name]) < 2:
        return None
    packed = base64.b64encode(one[name].astype("<f4").tobytes()).decode("ascii")
    return {"step": float(one["time"][1] - one["time"][0]), "values": packed}
