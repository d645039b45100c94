"""Which pixel of the first picture a designated target is: not one at an edge.

The ground designates a point on its map, the mast is off by some pixels, and a rock seven metres away is 30
wide. A pixel at the crest shows the rock or the ground metres behind, nobody knows which: stereo windows hold
both, the tracker follows the one and means the other. On a day that was looked at (383761578) three of five
targets began so, and the tool was put down 8 and 57 cm from two of them. The narrow pair tells: where what it
ranges round the pixel is not one surface, the nearest place that is one is taken, up to what the mast errs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.errors import TrackerError
from rover_iface.vision.narrow_range import KnownRange, NarrowSight, narrow_sight
from rover_iface.vision.seen_relief import SeenRelief
from rover_iface.vision.tracker import StereoView

MAST_PX = 12.0
"""How far a designated pixel may be off in the first wide picture: three times the mast's 3.5 mrad."""
EDGE_PX, EDGE_STEP_PX = 10.0, 3.0
"""Round a place, narrow pixels, what must lie on one surface: two wide pixels, and half the block of dense
stereo, by which what is in front seems wider; and how densely places are tried."""
RANGES_APART, MEDIAN_SIGMAS = 3.0, 2.0
"""Deviations of a window's range by which the median of what is ranged round it may differ, and what that
median is taken to be off if it differs by more: a window at the border of a shadow had a face 29 cm too near
and told 1.5 cm (828189, looked at). Twelve other medians there differed by 1.6 at most."""
EDGE_M, MAP_M = 0.15, 0.10
"""By how much ranges there may differ: 2 cm of ground seen at 8 degrees are 15 cm deep; how far off the map
may have the surface besides."""
FACE_PX, BENT_M, BESIDE_PX = 6.0, 0.006, 4.0
"""Round a place, narrow pixels, what should lie on a plane, and by how much it may bend (root mean square): a
target whose pixel leaves more open than that is known too poorly for a tool. How far a place that is plainer
may lie, wide pixels: one deviation of what the mast is off. Of 63 starts on 21 days (looked at) nine bent by
more, among them all four whose tools had been claimed and were wrong (21927 T1, 25774355 T2, 398055031 T1
and 808931828 T1: 0.7 to 2.3 cm); the others bent by 0.2 cm in the median. Seven of the nine have a plain
place 0.4 to 1.4 cm beside them, where the mast's error is 2.4 to 3.5."""
LEAST_RANGED, HALVES = 0.5, 8
"""Share of the pixels there that must be ranged in each half of what lies round a place, and how many such
halves are asked: shade and smooth sand leave holes anywhere, a crest leaves all of one side, as what lies
behind it is too far to be looked for. Of 33 starts on eleven looked-at days two, both of 681678, had a third
and an eighth of a half: one was placed on 3.3 cm off, one was lost. The others had 0.71 and more."""


def off_the_edge(
    target: str, wide: StereoView, pixel: Array, narrow: StereoView, away_m: float
) -> tuple[Array, NarrowSight | None]:
    """Return the pixel (2,) nearest to a designated one that lies on one surface, and its narrow sight.

    What the narrow pair ranges round it decides: of places that the mast's error hardly tells apart one is
    taken that does not bend. Where that does not show what the wide pair does, the pixel stays as it is,
    without a sight.

    Raises
    ------
    TrackerError
        If there is no such pixel as near as the mast may be off.
    """
    sight = narrow_sight(wide, pixel, narrow, away_m)
    middle = narrow.left_camera.project(_on_ray(wide, pixel, away_m)) if sight is None else sight.pixel
    round_it = _Ranged.of(narrow, np.asarray(middle, dtype=np.float64), away_m)
    if round_it is None:
        return pixel, sight
    on_it = sight and round_it.on_one_surface(sight, wide)
    if on_it is not None and round_it.bent_m(on_it.pixel - round_it.middle) <= BENT_M:
        return pixel, on_it
    plain = round_it.nearest(wide, pixel, narrow, BESIDE_PX, BENT_M)
    if plain is None and on_it is not None:
        return pixel, on_it
    beside = plain or round_it.nearest(wide, pixel, narrow, MAST_PX, math.inf)
    if beside is not None:
        return beside
    if sight is None:
        return pixel, None
    raise TrackerError(
        f'target "{target}" lies at an edge: within {MAST_PX:g} px, what the mast may be off, no place has '
        f"{2 * EDGE_PX * wide.left_camera.hs / narrow.left_camera.hs:.0f} px of the surface that is meant "
        "round it"
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Ranged:
    """What a narrow pair ranges round a designated place.

    Attributes
    ----------
    middle
        Its pixel (2,) in the left picture.
    off, away
        Offsets (n, 2) from there, px, and ranges (n,), m.
    meant_m
        How far away the surface should be.
    """

    middle: Array
    off: Array
    away: Array
    meant_m: float

    @classmethod
    def of(cls, narrow: StereoView, middle: Array, meant_m: float) -> _Ranged | None:
        """Return what lies round a pixel (2,), None where nothing is ranged."""
        cloud = SeenRelief(narrow, meant_m).cloud
        if cloud is None or not len(cloud.points) or not np.isfinite(middle).all():
            return None
        camera = narrow.left_camera
        away = np.linalg.norm(cloud.points - camera.C, axis=1)
        return cls(middle, np.asarray(camera.project(cloud.points)) - middle, np.asarray(away), meant_m)

    def on_one_surface(self, sight: NarrowSight, wide: StereoView) -> NarrowSight | None:
        """Return a sight whose own pixel lies on one surface, else None.

        A wide window that holds two is found elsewhere than it was looked for. The range, from the wide left
        camera, is that of the points round the pixel where the sight's window contradicts them.
        """
        at = sight.pixel - self.middle
        if self.edge_m(at) > EDGE_M:
            return None
        eye, ray = sight.view.left_camera.back_project(sight.pixel)
        away = float(np.median(self.away[np.hypot(*(self.off - at).T) < EDGE_PX]))
        ranged_m, known = float(np.linalg.norm(eye + away * ray - wide.left_camera.C)), sight.known
        if abs(ranged_m - known.range_m) <= RANGES_APART * known.sigma_m:
            return sight
        return replace(sight, known=KnownRange(ranged_m, MEDIAN_SIGMAS * known.sigma_m))

    def nearest(
        self, wide: StereoView, pixel: Array, narrow: StereoView, reach_px: float, most_bent_m: float
    ) -> tuple[Array, NarrowSight] | None:
        """Return the place nearest to a designated pixel (2,) that lies on one surface and bends no more, m,
        with its narrow sight; None where there is none within so many wide pixels.
        """
        scale = narrow.left_camera.hs / wide.left_camera.hs
        reach = scale * reach_px
        steps = np.arange(-EDGE_STEP_PX * (reach // EDGE_STEP_PX), reach + 1e-9, EDGE_STEP_PX)
        places = np.array([(x, y) for x in steps for y in steps if math.hypot(x, y) <= reach])
        for at in places[np.argsort(np.hypot(*places.T), kind="stable")]:
            if self.edge_m(at) > EDGE_M or self.bent_m(at) > most_bent_m:
                continue
            moved = np.asarray(pixel + at / scale)
            beside = narrow_sight(wide, moved, narrow, self.meant_m)
            on_it = beside and self.on_one_surface(beside, wide)
            if on_it is not None and self.bent_m(on_it.pixel - self.middle) <= most_bent_m:
                return moved, on_it
        return None

    def bent_m(self, at: Array) -> float:
        """Return how far what is ranged next to a place (2,), px, lies from a plane through it, m.

        Root mean square; infinite where too little is ranged to tell.
        """
        off = self.off - at
        near = np.hypot(*off.T) < FACE_PX
        if np.count_nonzero(near) < LEAST_RANGED * math.pi * FACE_PX**2:
            return math.inf
        design = np.column_stack((off[near], np.ones(int(near.sum()))))
        plane = np.linalg.lstsq(design, self.away[near], rcond=None)[0]
        return float(np.sqrt(np.mean((self.away[near] - design @ plane) ** 2)))

    def edge_m(self, at: Array) -> float:
        """Return how far ranges near a place (2,), px, differ from each other or from the surface meant.

        In metres, the latter beyond the error of the map; infinite where too little is ranged on any side.
        """
        off = self.off - at
        near = np.hypot(*off.T) < EDGE_PX
        here, turns = self.away[near], np.arange(HALVES) * math.tau / HALVES
        in_half = np.count_nonzero(off[near] @ np.array((np.cos(turns), np.sin(turns))) >= 0.0, axis=0)
        if in_half.min() < LEAST_RANGED * math.pi / 2.0 * EDGE_PX**2:
            return math.inf
        return max(float(np.ptp(here)), abs(float(np.median(here)) - self.meant_m) - MAP_M)


def _on_ray(view: StereoView, pixel: Array, away_m: float) -> Array:
    eye, ray = view.left_camera.back_project(pixel)
    return np.asarray(eye + away_m * ray)
