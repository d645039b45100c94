"""Patches of stereo cut at the outlines that the picture shows.

Stereo matches windows. Beside the outline of a rock that differs from the ground in brightness, the outline
itself is what a window matches by, and the ground beside it is given the rock's disparity (fattening: Kanade
and Okutomi 1994). Of a rock a few cells wide, 20 m away, that is more than the rock itself. The picture knows
better where the rock ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Cells = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class OutlineOptions:
    """Parameters of the cut.

    Attributes
    ----------
    reach_cells
        How far stereo's windows reach: 7 pixels of semi-global matching and 11 of the refinement, half of
        each, are three cells of 3 pixels.
    beside_cells
        How far beside a patch without such cells its rock is looked for: as a patch is moved at most.
    ring_cells, least_ring
        The ground that a patch is compared with lies beyond that reach, up to so many cells from it, and
        shows at least this many cells; of fewer no spread is told.
    unlike_sigmas, least_sigma
        A cell is unlike the ground when its brightness (0..1) differs from the ground's by so many of its
        robust deviations, which is at least that of 8 bits.
    least_cells
        Fewer cells that are unlike the ground are a pebble or a shadow, and no rock to be cut out.
    """

    reach_cells: int = 3
    beside_cells: int = 2
    ring_cells: int = 8
    least_ring: int = 30
    unlike_sigmas: float = 3.0
    least_sigma: float = 1.0 / 255.0
    least_cells: int = 4

    def __post_init__(self) -> None:
        if not 0 < self.reach_cells < self.ring_cells or self.least_cells < 1 or not self.least_sigma > 0:
            raise LocalizationError(
                f"outlines with a reach of {self.reach_cells} cells, a ring to {self.ring_cells} and "
                f"{self.least_cells} cells; the reach is less than the ring, all are positive"
            )


def cut_at_outlines(
    patch: Cells, raised: Mask, brightness: Array, least_cells: int, options: OutlineOptions
) -> list[tuple[Cells, bool]]:
    """Return the parts of a patch that are unlike the ground round it, and the rest out of their reach; with
    each, whether the picture shows its outline.

    `patch` are flat indices of cells of the raster `brightness` [rows, columns], 0..1, NaN where nothing was
    seen; `raised` [rows, columns] are the cells of all patches, which are not ground. A rest of fewer than
    `least_cells` is left away. A patch that is like its ground all over comes back whole: nothing says where
    it ends.
    """
    from scipy.ndimage import binary_dilation, label

    columns = brightness.shape[1]
    row, column = np.divmod(patch, columns)
    top, left = max(0, int(row.min()) - options.ring_cells), max(0, int(column.min()) - options.ring_cells)
    box = (
        slice(top, int(row.max()) + options.ring_cells + 1),
        slice(left, int(column.max()) + options.ring_cells + 1),
    )
    grey, others = brightness[box], raised[box]
    inside = np.zeros(grey.shape, dtype=bool)
    inside[row - top, column - left] = True
    square = np.ones((3, 3), dtype=bool)

    def grown(mask: Mask, cells: int) -> Mask:
        return np.asarray(binary_dilation(mask, square, iterations=cells))

    ring = grown(inside, options.ring_cells) & ~grown(inside, options.reach_cells) & ~others
    ring &= np.isfinite(grey)
    if ring.sum() < options.least_ring:
        return [(patch, False)]
    ground = float(np.median(grey[ring]))
    sigma = max(1.4826 * float(np.median(np.abs(grey[ring] - ground))), options.least_sigma)
    with np.errstate(invalid="ignore"):
        unlike = np.abs(grey - ground) > options.unlike_sigmas * sigma
    rocks = _rocks_within(unlike & inside, options.least_cells)
    if not rocks:
        # the window moves a small patch: part of its rock lies beside it
        beside = _rocks_within(unlike & grown(inside, options.beside_cells), options.least_cells)
        rocks = [rock for rock in beside if (rock & inside).any()]
    rocks = [rock & np.isfinite(grey) for rock in rocks]
    if not rocks:
        return [(patch, False)]
    rest = label(inside & ~grown(np.logical_or.reduce(rocks), options.reach_cells))[0]
    rests = [rest == k for k in range(1, int(rest.max()) + 1)]
    rests = [one for one in rests if one.sum() >= least_cells]

    def cells(mask: Mask) -> Cells:
        at_row, at_column = np.nonzero(mask)
        return np.asarray((at_row + top) * columns + at_column + left, dtype=np.int64)

    return [(cells(mask), True) for mask in rocks] + [(cells(mask), False) for mask in rests]


def _rocks_within(unlike: Mask, least_cells: int) -> list[Mask]:
    """Return the parts of a mask that hang together and have so many cells, with their holes filled."""
    from scipy.ndimage import binary_dilation, binary_fill_holes, label

    square = np.ones((3, 3), dtype=bool)
    # facets of one rock lie beside each other, with an edge of middling brightness between
    parts = label(binary_dilation(unlike, square), square)[0]
    found = [unlike & (parts == k) for k in range(1, int(parts.max()) + 1)]
    return [np.asarray(binary_fill_holes(part)) for part in found if part.sum() >= least_cells]
