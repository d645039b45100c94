"""How far the plane under the tool may lean otherwise than the cells that it is fitted to say.

Three things turn it: heights that are off, by errors that neighbouring points share; cells that no cloud
shows, whose surface may rise or fall; and a tool that comes down beside its place. Each is measured on the
place itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from rover_iface.placement.cloud import Array


@dataclass(frozen=True, slots=True)
class SpreadOptions:
    """What turns a fitted plane; the factors are set on 913 places of 52 rocks, 16000 to 16059.

    Attributes
    ----------
    error_m, shared_m
        What the narrow pair's heights err, and how far apart such errors are independent: the width of the
        block of 5 pixels that stereo matches.
    unseen, alike_m
        How much rougher than the deviation of the seen cells the unseen ones are, and how far apart their
        heights are independent.
    beside_m
        How far off the tool may come down, the arm's error; the turn that such a shift brings is one
        deviation.
    least_rad
        What is left where nothing else turns it. With these figures the true normal lies within two
        deviations of the told one in 96 of 100 places, within three in 99.5; with 1 degree for all it was 67
        and 83.
    """

    error_m: float = 0.0007
    shared_m: float = 0.005
    unseen: float = 2.0
    alike_m: float = 0.012
    beside_m: float = 0.002
    least_rad: float = math.radians(0.6)


@dataclass(frozen=True, slots=True, eq=False)
class _Disc:
    """Cells (n, 2), m, of a whole disc, what each height adds to the slopes (2, n), and how far the errors of
    any two are alike (n, n), of seen and of unseen ones.
    """

    whole: dict[tuple[int, int], int]
    gain: Array
    seen: Array
    unseen: Array


@lru_cache(maxsize=8)
def _disc(radius_m: float, cell_m: float, options: SpreadOptions) -> _Disc:
    count = math.ceil(radius_m / cell_m)
    line = np.arange(-count, count)
    whole = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    whole = whole[np.hypot(*((whole + 0.5) * cell_m).T) < radius_m]
    places = (whole + 0.5) * cell_m
    gain = np.linalg.pinv(np.column_stack((places, np.ones(len(places)))))[:2]
    apart = np.linalg.norm(places[:, None] - places[None], axis=2)
    return _Disc(
        {(int(a), int(b)): k for k, (a, b) in enumerate(whole)},
        np.asarray(gain),
        np.exp(-apart / options.shared_m),
        np.exp(-apart / options.alike_m),
    )


def plane_of(cells: Array, radius_m: float, support_m: float) -> tuple[Array, Array]:
    """Return the plane (3,) (two slopes and the height in the middle, m) through the cells (n, 3) of a disc,
    and those that it is fitted to.

    What lies `support_m` below the middle of the surface bears no tool. Fewer than three cells give a flat
    plane.
    """
    core = cells[np.hypot(cells[:, 0], cells[:, 1]) < radius_m]
    if len(core) < 3:
        return np.zeros(3), core
    # as the tool's face does: it rests on the upper part, not on what lies a hand's breadth below
    core = core[core[:, 2] > np.median(core[:, 2]) - support_m]
    design = np.column_stack((core[:, :2], np.ones(len(core))))
    return np.asarray(np.linalg.lstsq(design, core[:, 2], rcond=None)[0]), core


def plane_spread(
    cells: Array, radius_m: float, cell_m: float, support_m: float, options: SpreadOptions | None = None
) -> float:
    """Return one standard deviation, rad, of the normal of the plane under a tool, in its worst direction.

    Parameters
    ----------
    cells
        (n, 3), m: middle and height of each cell of a raster that shows the surface, under the tool and
        somewhat round it, across the plane and along its normal.
    radius_m, cell_m, support_m
        The tool's radius, the width of a cell, and see `plane_of`.
    """
    options = options or SpreadOptions()
    plane, core = plane_of(cells, radius_m, support_m)
    disc = _disc(radius_m, cell_m, options)
    rough_m = float(np.sqrt(np.mean((core[:, 2] - core[:, :2] @ plane[:2] - plane[2]) ** 2)))
    shown = np.zeros(disc.gain.shape[1], np.bool_)
    for a, b in np.floor(core[:, :2] / cell_m).astype(np.int64):
        if (place := disc.whole.get((int(a), int(b)))) is not None:
            shown[place] = True
    hidden = ~shown
    turns = options.error_m**2 * _spread(disc.gain[:, shown], disc.seen[np.ix_(shown, shown)])
    turns += (options.unseen * rough_m) ** 2 * _spread(
        disc.gain[:, hidden], disc.unseen[np.ix_(hidden, hidden)]
    )
    moved = [
        plane_of(cells - (*shift, 0.0), radius_m, support_m)[0][:2] - plane[:2]
        for shift in options.beside_m
        * np.array([(math.cos(t), math.sin(t)) for t in np.arange(8) * math.tau / 8])
    ]
    beside2 = float(np.mean(np.square(moved).sum(axis=1)))
    return math.atan(math.sqrt(float(np.linalg.eigvalsh(turns)[-1]) + beside2 + options.least_rad**2))


def _spread(gain: Array, alike: Array) -> Array:
    return np.asarray(gain @ alike @ gain.T)
