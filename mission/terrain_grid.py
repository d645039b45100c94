"""Heights on a square grid: plain arrays, the one form in which ground crosses between rooms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


@dataclass(frozen=True, slots=True, eq=False)
class TerrainGrid:
    """Heights on a square grid, north up as in a map image.

    Parameters
    ----------
    origin_east_m, origin_north_m
        Centre of the cell `heights_m[0, 0]`, which is the **north-west** corner.
    spacing_m
        Distance between cell centres. Column j lies at `origin_east_m + j * spacing_m`, row i at
        `origin_north_m - i * spacing_m`.
    heights_m
        Shape (rows, columns), metres; NaN where nothing is known.
    """

    origin_east_m: float
    origin_north_m: float
    spacing_m: float
    heights_m: npt.NDArray[np.floating[Any]]

    @property
    def bounds_m(self) -> tuple[float, float, float, float]:
        """West, south, east and north edge of the grid, metres."""
        rows, columns = self.heights_m.shape
        half = self.spacing_m / 2
        return (
            self.origin_east_m - half,
            self.origin_north_m - (rows - 1) * self.spacing_m - half,
            self.origin_east_m + (columns - 1) * self.spacing_m + half,
            self.origin_north_m + half,
        )
