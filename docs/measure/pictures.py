"""Pictures of the pages, and the decimation that keeps them small."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

STYLE = Path(__file__).parent / "plots.mplstyle"
# One colour for each, on every picture
COLOURS = {
    "reference": "black",
    "paper": "tab:gray",
    "bilstm_w19": "tab:blue",
    "bilstm_residual_w19": "tab:cyan",
    "smoother": "tab:olive",
    "carried": "tab:red",
    "fir_w19": "tab:orange",
    "kalman": "tab:green",
}


@contextmanager
def picture(file: Path, **layout: Any) -> Iterator[tuple[Any, Any]]:
    """Axes to draw in (as `plt.subplots(**layout)`); saved as SVG, the same bytes each time."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    with plt.style.context(STYLE):
        figure, axes = plt.subplots(**layout)
        yield figure, axes
        file.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(file, metadata={"Date": None, "Creator": None})
        plt.close(figure)


def envelope(values: Array, count: int) -> tuple[Array, Array, Array]:
    """Return middle index, least and largest value of `count` stretches of `values` (samples,).

    A line of ten thousand samples is a blot to the eye and large as a file.
    """
    parts = np.array_split(values, min(count, len(values)))
    lengths = np.array([len(part) for part in parts])
    middle = np.cumsum(lengths) - (lengths + 1) / 2
    return middle, np.array([p.min() for p in parts]), np.array([p.max() for p in parts])
