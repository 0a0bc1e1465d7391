"""The pictures of docs/paper.md: the reading of Table 4, and Figures 7 and 8."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pictures import COLOURS, envelope, picture

from sensor.channels import SAMPLE_RATE_HZ
from sensor.metrics.figures import BAND_PERCENTILES
from sensor.paper.reading import projection, readings

Array = npt.NDArray[np.float64]

PAPER_BAND = (-0.01384, 0.01402)
"""What the paper's Figure 8 gives for "most errors" [m/s]."""
SECTION_S = (28.0, 38.0)
KINDS = {
    "flat": ("flat manoeuvres, fitted", "o", "tab:blue"),
    "limit": ("turns above 4 m/s²: speed lost", "v", "tab:orange"),
    "bumps": ("bumpy road", "s", "tab:red"),
    "misprint": ("slalom 25 km/h: misprint", "x", "tab:gray"),
}


@dataclass(frozen=True)
class Lap:
    """A lap's reference and estimates by name, (samples, 4) in m/s, NaN where not valid."""

    truth: Array
    estimates: Mapping[str, Array]

    @property
    def time(self) -> Array:
        """Time of each sample [s]."""
        return np.arange(len(self.truth)) / SAMPLE_RATE_HZ

    def error(self, name: str) -> Array:
        """Estimate minus truth (valid samples, 4) [m/s]."""
        error = self.estimates[name] - self.truth
        return np.asarray(error[np.isfinite(error).all(axis=1)])


def reference_and_speed(file: Path) -> None:
    """The paper's reference against the speed in the row's name, with the fitted projection."""
    fit = projection()
    with picture(file, figsize=(6.4, 3.6)) as (_, axes):
        for kind, (label, marker, colour) in KINDS.items():
            chosen = [one for one in readings() if one.kind == kind and one.speed is not None]
            speed = np.array([3.6 * (one.speed or 0.0) for one in chosen])
            rms = np.array([1e3 * one.truth_rms for one in chosen])
            digits = np.abs(
                [[1e3 * one.lowest, 1e3 * one.highest] for one in chosen] - rms[:, None]
            )
            style = {"fmt": marker, "color": colour, "label": label, "markersize": 4}
            axes.errorbar(speed, rms, digits.T, elinewidth=0.8, **style)
        line = np.array([0.0, 105.0])
        label = f"{fit.slope:.5f} v: θ₀ = {np.rad2deg(fit.angle):.2f}°"
        axes.plot(line, 1e3 * fit.slope * line / 3.6, "k-", linewidth=0.9, label=label)
        axes.set(xlabel="speed in the row's name, km/h", ylabel="rms of the reference, mm/s")
        axes.set(xlim=(0, 105), ylim=(0, 240))
        axes.legend(loc="upper left", fontsize=8)


def figure_7(file: Path, lap: Lap, names: Mapping[str, str]) -> None:
    """Time section, absolute error over the lap and relative error of the spectrum, wheel FL."""
    with picture(file, nrows=3, figsize=(7.2, 7.2)) as (_, (section, errors, spectrum)):
        rows = slice(*(int(SAMPLE_RATE_HZ * s) for s in SECTION_S))
        time = lap.time[rows]
        section.plot(time, 1e3 * lap.truth[rows, 0], color=COLOURS["reference"], label="reference")
        for name, label in names.items():
            velocity = 1e3 * lap.estimates[name][rows, 0]
            section.plot(time, velocity, color=COLOURS[name], linewidth=0.9, label=label)
        section.set(xlabel="time, s", ylabel="v_rel FL, mm/s", title="a) reference and estimate")
        for name, label in names.items():
            _absolute_error(errors, lap, name, label)
            frequency, relative = relative_spectrum(lap.truth[:, 0], lap.estimates[name][:, 0])
            spectrum.plot(frequency, relative, color=COLOURS[name], label=label)
        errors.set(xlabel="time, s", ylabel="largest |error| FL in 0.5 s, mm/s", ylim=(0, None))
        errors.set(title="b) absolute error")
        spectrum.set(xlabel="frequency, Hz", ylabel="relative error of the amplitude, %")
        spectrum.set(title="c) spectrum", xlim=(0, 15), ylim=(0, 300))
        for axes, place in ((section, "right"), (errors, "right"), (spectrum, "left")):
            axes.legend(fontsize=8, loc=f"upper {place}", ncols=4)


def _absolute_error(axes: Any, lap: Lap, name: str, label: str) -> None:
    error = 1e3 * np.abs(np.nan_to_num(lap.estimates[name][:, 0] - lap.truth[:, 0]))
    middle, _, largest = envelope(error, len(error) // 50)
    axes.plot(middle / SAMPLE_RATE_HZ, largest, color=COLOURS[name], linewidth=0.8, label=label)


def relative_spectrum(truth: Array, estimate: Array) -> tuple[Array, Array]:
    """Return frequency [Hz] and | |estimate| - |truth| | / |truth| [%] of the amplitude spectra.

    Welch's mean over stretches of 5.12 s: the ratio of two raw spectra is noise.
    """
    from scipy.signal import welch

    valid = np.isfinite(estimate)
    frequency, reference = welch(truth[valid], SAMPLE_RATE_HZ, nperseg=512)
    _, predicted = welch(estimate[valid], SAMPLE_RATE_HZ, nperseg=512)
    delta = np.abs(np.sqrt(predicted) - np.sqrt(reference)) / np.sqrt(reference)
    return frequency, 100.0 * delta


def figure_8(file: Path, lap: Lap, name: str) -> tuple[float, float]:
    """Histogram of the errors at all wheels, and beside it a normal distribution of the same
    deviation; return the central 95 % [m/s].
    """
    error = lap.error(name).reshape(-1)
    low, high = np.percentile(error, BAND_PERCENTILES)
    with picture(file, figsize=(6.4, 3.4)) as (_, axes):
        edges = np.linspace(-40, 40, 81)
        axes.hist(1e3 * error, edges, color=COLOURS[name], alpha=0.7, density=True, label="errors")
        deviation = 1e3 * np.std(error)
        middle = (edges[1:] + edges[:-1]) / 2
        normal = np.exp(-0.5 * (middle / deviation) ** 2) / (deviation * np.sqrt(2 * np.pi))
        axes.plot(middle, normal, "k-", linewidth=0.9, label="normal, same deviation")
        style = {"linestyle": "--", "linewidth": 1.0}
        for band, colour, label in (
            ((low, high), COLOURS[name], "central 95 %, ours"),
            (PAPER_BAND, "black", "most errors, paper"),
        ):
            axes.axvline(1e3 * band[0], color=colour, label=label, **style)
            axes.axvline(1e3 * band[1], color=colour, **style)
        axes.set(xlabel="error, mm/s", ylabel="density, 1/(mm/s)")
        axes.legend(fontsize=8)
    return float(low), float(high)
