"""Pictures of `make validation`: the same bytes from the same numbers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from gates import PLOTS, SECTIONS, Plot

Array = npt.NDArray[np.float64]


def log_bands(f: Array, power: Array, low: float, high: float, count: int = 120) -> tuple[Any, Any]:
    """Means of a spectrum (n, ...) in logarithmic bands: centres and values, empty bands left out.

    Spectra of thousands of lines are noise to the eye and large as files.
    """
    edges = np.geomspace(low, high, count + 1)
    place = np.digitize(f, edges) - 1
    used = [k for k in range(count) if (place == k).any()]
    values = np.array([power[place == k].mean(axis=0) for k in used])
    return np.array([f[place == k].mean() for k in used]), values


STYLE = Path(__file__).parents[1] / "docs" / "measure" / "plots.mplstyle"


@contextmanager
def picture(
    folder: Path, section: str, file: str, caption: str, **layout: Any
) -> Iterator[tuple[Any, Any]]:
    """Axes to draw in (as `plt.subplots(**layout)`); saved as SVG and entered in the page."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    assert section in SECTIONS, section
    with plt.style.context(STYLE):
        figure, axes = plt.subplots(**layout)
        yield figure, axes
        figure.savefig(folder / f"{file}.svg", metadata={"Date": None, "Creator": None})
        plt.close(figure)
    PLOTS[file] = Plot(section, f"{file}.svg", caption)
