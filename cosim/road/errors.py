"""What can be wrong with a road."""

from __future__ import annotations

from cosim.errors import InputError


class RoadError(InputError, ValueError):
    """A track, a surface or the road's cache cannot be had as asked; the sentence says why."""
