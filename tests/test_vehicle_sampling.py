"""What the 100 Hz channels cannot show: power above 50 Hz, which sampling folds down.

The channels are taken at 1 kHz. Ideal channels have no filter; the sensor stage is the IMU's
second-order low-pass.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from gates import STUDIES, Study, at_most, gate
from scipy import signal
from validation_plots import log_bands, picture
from vehicle_rig import DAMPERS, Array, Record, Rig, run, straight_track

from cosim.fmi import Value
from cosim.road import Cobbles, Iso8608, Surface, build_road
from sensor.channels import CHANNELS

SECTION = "Sampling"
RATE, H = 100.0, 0.001  # of the channels [Hz]; of the study [s]
SEGMENT = 2000
CUTOFF = 30.0  # of the IMU's low-pass in the study [Hz]
IMU = {f"Car.{n}": f"Sensor.Imu.{n}" for n in ("ax", "ay", "az", "RollVel", "PitchVel", "YawRate")}
NAMES = tuple(c.name for c in CHANNELS)
SURFACES: dict[str, tuple[Callable[[], Surface], float]] = {
    "class C at 50 km/h": (lambda: Iso8608("C", 3), 50.0),
    "cobblestones at 30 km/h": (lambda: Cobbles(3), 30.0),
}


@cache
def ride(surface: str, cutoff: float = 0.0, seconds: float = 22.0) -> Record:
    """Straight on with half-hard dampers."""
    make, kmh = SURFACES[surface]
    speed = kmh / 3.6
    road = str(build_road(straight_track(speed * seconds + 30.0), make()))
    start: dict[str, Value] = {
        "Init.Velocity": speed, "Road.File": road, "Sensor.Imu.Cutoff": cutoff,
    }  # fmt: skip

    def drive(rig: Rig) -> None:
        rig.inputs[DAMPERS] = 0.3

    return run(seconds, start, drive, h=H)


def spectrum(x: Array) -> tuple[Array, Array]:
    """Frequencies [Hz] and power density of what follows the first two seconds."""
    f, power = signal.welch(x[2000:], 1.0 / H, nperseg=SEGMENT, detrend="linear")
    return f, power


def folded(x: Array, top: float) -> float:
    """Power that sampling at RATE folds into 0 .. top, over the power that belongs there [-]."""
    f, power = spectrum(x)
    to = np.abs(f - RATE * np.round(f / RATE))  # where each frequency shows
    above, low = f > 0.5 * RATE, f > 0.4  # the slow change of speed is no part of it
    return float(power[above & (to <= top)].sum() / power[~above & low & (f <= top)].sum())


# ---------------------------------------------------------------- the IMU's low-pass


@pytest.mark.parametrize("cutoff", [15.0, 30.0, 60.0])
def test_the_imus_low_pass_is_a_butterworth(cutoff: float) -> None:
    """The same ride with and without it: their transfer against SciPy's analogue filter."""
    surface = "cobblestones at 30 km/h"
    before, behind = ride(surface, 0.0, 8.0), ride(surface, cutoff, 8.0)
    b, a = signal.butter(2, 2.0 * np.pi * cutoff, analog=True)
    worst = []
    for name in ("Sensor.Imu.ax", "Sensor.Imu.az", "Sensor.Imu.PitchVel"):
        x, y = before[name][1000:], behind[name][1000:]
        f, power = signal.welch(x, 1.0 / H, nperseg=SEGMENT)
        cross = signal.csd(x, y, 1.0 / H, nperseg=SEGMENT)[1]
        used = (f > 2.0) & (f < 50.0)
        wanted = signal.freqs(b, a, 2.0 * np.pi * f[used])[1]
        worst.append(float(np.abs(cross[used] / power[used] - wanted).max()))
    check = f"IMU low-pass at {cutoff:g} Hz: ax az pitch rate, complex gain 2 to 50 Hz, error [-]"
    gate(SECTION, check, "SciPy's analogue Butterworth", worst, at_most(0.05))


# ---------------------------------------------------------------- what folds down


@pytest.mark.validation
@pytest.mark.parametrize("surface", SURFACES)
def test_what_folds_into_the_channels(surface: str) -> None:
    ideal, filtered = ride(surface), ride(surface, CUTOFF)
    rows: list[tuple[str | float, ...]] = []
    moving = [n for n in NAMES if np.ptp(ideal[n]) > 1e-12]  # nobody steers here
    for name in moving:
        f, power = spectrum(ideal[name])
        share = float(power[f > 0.5 * RATE].sum() / power[f > 0.4].sum())
        cells = [100.0 * v for v in (share, folded(ideal[name], 50.0), folded(ideal[name], 15.0))]
        stage = IMU.get(name)
        behind = [100.0 * folded(filtered[stage], t) for t in (50.0, 15.0)] if stage else []
        rows.append((name, *cells, *(behind or ["", ""])))
    text = (
        f"{surface[0].upper() + surface[1:]}, channels at 1 kHz: power above 50 Hz over that above "
        "0.4 Hz, and what sampling at 100 Hz folds into 0 to 50 and 0 to 15 Hz over what belongs "
        f"there, in %; ideal, and behind the IMU's low-pass at {CUTOFF:g} Hz."
    )
    header = ("channel", "above 50 Hz", "into 50 Hz", "into 15 Hz", "filtered: 50 Hz", "15 Hz")
    STUDIES.append(Study(SECTION, text, header, tuple(rows)))
    what = "largest share folded into 0 to 15 Hz [-]"
    oracle = "power at 1 kHz"
    rest = max(folded(ideal[n], 15.0) for n in moving if n != "Car.ax")
    gate(SECTION, f"{surface}, ideal channels but Car.ax: {what}", oracle, rest, at_most(0.01))
    # the road's slope pushes the body along without a bushing in between (left-out.md)
    along = folded(ideal["Car.ax"], 15.0)
    gate(SECTION, f"{surface}, ideal Car.ax: {what}", oracle, along, at_most(0.2))
    stage = max(folded(filtered[n], 15.0) for n in IMU.values())
    check = f"{surface}, IMU behind its low-pass: {what}"
    gate(SECTION, check, oracle, stage, at_most(0.01))


@pytest.mark.validation
def test_picture_of_spectra(plots: Path) -> None:
    caption = (
        "Channels at 1 kHz: amplitude spectra on class C at 50 km/h and on cobblestones at "
        "30 km/h; dashed behind the IMU's low-pass. Grey: beyond what 100 Hz can show."
    )
    panels = (("Car.ax", "m/s²"), ("Car.az", "m/s²"), ("Car.vFL", "m/s"))
    with picture(plots, SECTION, "sampling", caption, ncols=3, figsize=(11, 3.6)) as (_, axes):
        for ax, (name, unit) in zip(axes, panels, strict=True):
            for k, surface in enumerate(SURFACES):
                f, power = log_bands(*spectrum(ride(surface)[name]), 0.4, 500.0)
                ax.loglog(f, np.sqrt(power), f"C{k}", label=surface)
                if name in IMU:
                    f, power = log_bands(*spectrum(ride(surface, CUTOFF)[IMU[name]]), 0.4, 500.0)
                    ax.loglog(f, np.sqrt(power), f"C{k}--", lw=0.9)
            ax.axvspan(0.5 * RATE, 500.0, color="0.92", zorder=0)
            ax.set_title(name)
            ax.set_ylabel(f"amplitude density, ({unit})/√Hz")
            ax.set_xlabel("frequency, Hz")
            ax.set_xlim(0.5, 500.0)
        axes[0].legend(fontsize=7)
