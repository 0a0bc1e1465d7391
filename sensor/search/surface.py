"""The search's surface (Figure 5 of the paper): validation RMSE over the units of both layers, as a
Gaussian process sees it.
"""

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Surface:
    """`mean` and `std` (units, hidden) [m/s] of the RMSE on the grid `units` x `hidden`; `std` is
    that of the surface itself, without the scatter of single trainings.
    """

    units: Array
    hidden: Array
    mean: Array
    std: Array

    def as_dict(self) -> dict[str, Any]:
        """Return the surface for JSON: units as whole numbers, RMSE to 0.001 mm/s."""
        return {
            "units": self.units.astype(int).tolist(),
            "hidden": self.hidden.astype(int).tolist(),
            "mean": self.mean.round(6).tolist(),
            "std": self.std.round(6).tolist(),
        }


def fit_surface(shapes: Array, rmse: Array, grid: Array) -> Surface:
    """Fit a Gaussian process (Matern 5/2, a length for each layer, scatter) to trials.

    `shapes` (trials, 2) are units and hidden units, `rmse` (trials,) is in m/s; `grid` (n,) are the
    numbers of units where the surface is wanted, for both layers.
    """
    largest = float(grid.max())
    kernel = ConstantKernel() * Matern([0.5, 0.5], (0.05, 5.0), nu=2.5) + WhiteKernel(
        0.01, (1e-5, 1.0)
    )
    process = GaussianProcessRegressor(
        kernel, normalize_y=True, n_restarts_optimizer=4, random_state=0
    )
    with warnings.catch_warnings():
        # With a dozen trials a length often ends at its bound; the bound is the prior knowledge.
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(shapes / largest, rmse)
    units, hidden = np.meshgrid(grid, grid, indexing="ij")
    points = np.stack([units.ravel(), hidden.ravel()], axis=1) / largest
    mean, total = process.predict(points, return_std=True)
    scatter = np.sqrt(process.kernel_.k2.noise_level) * float(np.std(rmse))
    std = np.sqrt(np.maximum(total**2 - scatter**2, 0.0))
    return Surface(grid, grid, mean.reshape(units.shape), std.reshape(units.shape))
