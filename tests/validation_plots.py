"""Pictures of `make validation`: the same bytes from the same numbers."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gates import PLOTS, SECTIONS, Plot

STYLE = {
    "svg.hashsalt": "suspension-cosim", "font.size": 9.0, "axes.grid": True, "grid.alpha": 0.3,
    "axes.spines.top": False, "axes.spines.right": False, "lines.linewidth": 1.3,
    "legend.frameon": False, "axes.titlesize": 10.0, "figure.constrained_layout.use": True,
}  # fmt: skip


@contextmanager
def picture(
    folder: Path, section: str, file: str, caption: str, **layout: Any
) -> Iterator[tuple[Any, Any]]:
    """Axes to draw in (as `plt.subplots(**layout)`); saved as SVG and entered in the page."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    assert section in SECTIONS, section
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(**layout)
        yield figure, axes
        figure.savefig(folder / f"{file}.svg", metadata={"Date": None, "Creator": None})
        plt.close(figure)
    PLOTS[file] = Plot(section, f"{file}.svg", caption)
