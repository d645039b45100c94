"""The surface under the tool at a point: what is measured of it, and which limits it breaks."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from rover_iface.placement import patch_kernels as kernels
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.cloud_edges import away_from_edges
from rover_iface.placement.safety_limits import SafetyLimits
from rover_iface.placement.verdict import Finding, PatchMeasures, Reason
from rover_iface.profile import RoverProfile

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

BALL = 3.0
"""Points within so many radii of the tool, and within its length, are looked at: what lies deep under it
counts too."""

LEAST_POINTS = 8

COVER_CELL_M, COVERED_M = 0.005, 0.03
"""A point so far below another of the same cell across the tool's path lies behind the surface."""

SINGLE_POINTS = 8
"""So many points that stand high in the tool's path may be wrong matches; more are a thing."""

WAY_BEHIND_M = 0.02
"""So far behind what the camera sees a place is hidden."""

FINE_M = 0.0375
"""Within so far of the designated point places are tried densely: a quarter of how far they are usually
taken. A rover that takes none farther than 1.5 cm tries all of them so."""


Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Judged:
    """A point, the surface under the tool there, and what is wrong with it."""

    point: Array
    normal: Array | None
    measures: PatchMeasures | None
    findings: tuple[Finding, ...]
    strain: float = math.inf
    """Largest share of a limit that the surface takes: relief, gaps, steps, uncertainty of the normal."""
    restless: Finding | None = None
    """Why a safe point is not calm; None when it is."""
    close_strain: float = math.inf
    """Share of its limits that the surface takes when it is looked at closely; above 1 it is not safe."""

    def with_finding(self, finding: Finding) -> Judged:
        """Return the same with one more finding."""
        return replace(self, findings=(*self.findings, finding))


@dataclass(frozen=True, eq=False)
class _Window:
    """The part of a cloud round a place: only it is searched for the points under the tool."""

    middle: Array
    radius_m: float
    cloud: SurfaceCloud
    mine: npt.NDArray[np.bool_]
    trusted: npt.NDArray[np.bool_]
    weight: Array
    spacing_m: Array


class PatchCheck:
    """Judges points of one rock (or of the ground) of a cloud.

    Parameters
    ----------
    labels, label
        (n,) of the cloud's points, and the one that the tool must stand on.
    axis
        (3,), approach axis, or None.
    """

    def __init__(
        self,
        cloud: SurfaceCloud,
        labels: npt.NDArray[np.int64],
        label: int,
        profile: RoverProfile,
        limits: SafetyLimits,
        axis: Array | None = None,
    ) -> None:
        self.cloud, self.labels, self.label, self.limits, self.axis = cloud, labels, label, limits, axis
        self.radius_m = limits.tool_radius_m or profile.arm.tool_radius_m
        self.trusted = away_from_edges(cloud, limits.edge_px, limits.edge_jump_m)
        self._near = self.radius_m + limits.margin_m
        self._wide = self.radius_m + max(limits.margin_m, limits.calm_margin_m)
        self._above = limits.tool_length_m + limits.clear_m
        self._ball = max(BALL * self._wide, math.hypot(self._above, self._wide + limits.calm_margin_m))
        self._last: _Window | None = None

    def candidates(self, at: Array, *, coarse: float = 2.5) -> list[Array]:
        """Return the points to be tried: the surface at the designated one, then one for each cell of the
        same rock, by distance.

        Cells are `grid_m` wide within `FINE_M`, and `coarse` times that further off. The nearest point of
        each is tried.

        `at` and what comes back are points (3,), frame of the cloud, m.
        """
        cloud = self.cloud
        near = np.asarray(
            cloud.tree.query_ball_point(at, max(self.limits.search_m, self.limits.grid_m)), dtype=np.int64
        )
        near = near[self.labels[near] == self.label]
        away = np.linalg.norm(cloud.points[near] - at, axis=1)
        order = np.argsort(away, kind="stable")
        near, away = near[order], away[order]
        wide = np.where(away < FINE_M, 1.0, coarse)
        cells = np.floor(cloud.points[near] / (self.limits.grid_m * wide)[:, None]).astype(np.int64)
        first = np.unique(np.column_stack((cells, wide)), axis=0, return_index=True)[1]
        return [at, *cloud.points[near[np.sort(first)]]]

    def judge(self, point: Array) -> Judged:
        """Return what the tool would stand on at a point (3,) near the surface, in the frame of the cloud, m,
        and every limit that it breaks.

        The point returned is the one on the fitted plane.
        """
        window = self._window(point, self._ball)
        cloud = window.cloud
        inner = kernels.in_ball(cloud.points, point, self._wide)
        own = inner[window.mine[inner] & window.trusted[inner]]
        if len(own) < LEAST_POINTS:
            few = Finding(Reason.FEW_POINTS, float(len(own)), float(LEAST_POINTS))
            return Judged(point, None, None, (few,))
        eye = cloud.eye
        outward = np.asarray(cloud.up) if eye is None else (eye - point) / np.linalg.norm(eye - point)
        middle, normal = kernels.fit_plane(cloud.points[own], window.weight[own], outward)
        on_plane = point - ((point - middle) @ normal) * normal
        measures = self._measure(window, on_plane, normal, outward)
        return Judged(
            on_plane,
            normal,
            measures,
            self._findings(measures),
            self._strain(measures),
            self._restless(measures),
        )

    def sight(self, way: Array) -> tuple[Bools, Bools]:
        """Return which places (n, 3), frame of the cloud, m, something hides from the camera, and which it
        sees to be free.

        Behind a rock that stands before a place may be more of that rock. Clouds without order or eye tell
        nothing; nor do pixels without stereo.
        """
        eye = self.cloud.eye
        if eye is None or self.cloud.pixels is None:
            return np.zeros(len(way), bool), np.zeros(len(way), bool)
        way = way - eye
        far = np.linalg.norm(way, axis=1)
        off, nearest = self._rays.query(way / far[:, None])
        seen = off < 4.0 * max(self.cloud.pitch_rad, 1e-4)
        before = np.linalg.norm(self.cloud.points[nearest] - eye, axis=1) < far - WAY_BEHIND_M
        return np.asarray(seen & before), np.asarray(seen & ~before)

    @cached_property
    def _rays(self) -> cKDTree:
        """Return the directions in which the camera sees the points, ordered for search."""
        from scipy.spatial import cKDTree

        assert self.cloud.eye is not None
        away = self.cloud.points - self.cloud.eye
        return cKDTree(away / np.linalg.norm(away, axis=1, keepdims=True))

    def _window(self, point: Array, radius_m: float) -> _Window:
        """Return the points within `radius_m` of `point`, and as far round it as others will be asked for."""
        last = self._last
        if last is not None and np.linalg.norm(point - last.middle) + radius_m < last.radius_m:
            return last
        wide = self.limits.search_m + 1.2 * radius_m
        index = kernels.in_ball(self.cloud.points, np.asarray(point, dtype=np.float64), wide)
        part = self.cloud.subset(index)
        self._last = _Window(
            np.asarray(point),
            wide,
            part,
            self.labels[index] == self.label,
            self.trusted[index],
            1.0 / np.maximum(np.trace(part.covariances, axis1=1, axis2=2), 1e-12),
            self.cloud.spacing_m[index],
        )
        return self._last

    def _measure(self, window: _Window, at: Array, normal: Array, outward: Array) -> PatchMeasures:
        cloud = window.cloud
        ball = kernels.in_ball(cloud.points, at, self._ball)
        # past the top of a slab its far side is seen, deep under the tool but behind what that meets
        hides = window.trusted[ball]
        ball = ball[~kernels.covered(cloud.points[ball], hides, at, normal, COVER_CELL_M, COVERED_M)]
        across, height = kernels.across_and_height(cloud.points[ball], at, normal)
        of_trust = window.trusted[ball]
        # what lies in the cylinder under the tool, however deep
        near = kernels.relief(across, height, self._near, self._above)
        wide = kernels.relief(across, height, self._wide, self._above)
        beside = kernels.obstruction(
            across, height, self._near, self.limits.calm_margin_m, self._above, SINGLE_POINTS
        )
        sound = kernels.relief(across[of_trust], height[of_trust], self._near, self._above)
        surface = ball[wide[0]]
        sigma = kernels.median_sigma(cloud.covariances, surface, normal)
        trusted = window.trusted[surface]
        kept = surface[trusted]
        pixel = self._pixel(window, kept, at, normal)
        share, hole = self._gaps(cloud.points[kept], at, normal, self._near, pixel)
        wide_hole = self._gaps(cloud.points[kept], at, normal, self._wide, pixel)[1]
        return PatchMeasures(
            points=len(surface),
            valid_share=share,
            hole_m=hole,
            wide_hole_m=wide_hole,
            doubtful_share=1.0 - float(trusted.mean()),
            protrusion_m=near[1],
            depth_m=near[2],
            rms_m=near[3],
            wide_protrusion_m=wide[1],
            wide_depth_m=wide[2],
            wide_rms_m=wide[3],
            sound_protrusion_m=sound[1],
            sound_depth_m=sound[2],
            sigma_m=sigma,
            normal_sigma_rad=self._normal_sigma(cloud.points, surface, normal, sigma),
            view_angle_rad=_angle(normal, outward) if cloud.eye is not None else 0.0,
            rock_share=float(window.mine[ball[near[0]]].mean()) if near[0].any() else 0.0,
            beside_m=beside,
            slope_rad=0.0 if self.axis is None else _angle(normal, self.axis),
        )

    def _pixel(self, window: _Window, index: npt.NDArray[np.int64], at: Array, normal: Array) -> float:
        """Return the length of a pixel on the surface: its slant makes it up to three times its width."""
        if not len(index):
            return 0.0
        pixel = float(np.median(window.spacing_m[index]))
        eye = window.cloud.eye
        if eye is None:
            return pixel
        slant = abs(float((eye - at) @ normal)) / float(np.linalg.norm(eye - at))
        return pixel / max(slant, 1.0 / 3.0)

    def _gaps(
        self, points: Array, at: Array, normal: Array, radius: float, pixel: float
    ) -> tuple[float, float]:
        """Return the share of the disc of `radius` that lies within a pixel of a point (n, 3), and the
        diameter of the largest hole.
        """
        if not len(points):
            return 0.0, 2.0 * radius
        share, hole = kernels.disc_gaps(points, at, normal, radius, pixel)
        return float(share), min(float(hole), 2.0 * radius)

    def _normal_sigma(
        self, points: Array, surface: npt.NDArray[np.int64], normal: Array, sigma: float
    ) -> float:
        """Return the normal's uncertainty: errors are shared by patches of 5 x 5 pixels."""
        lever2 = kernels.middle_lever(points, surface, normal)
        patches = max(3.0, len(surface) / 25.0)
        return float(math.atan(sigma / math.sqrt(max(lever2 * patches, 1e-12))))

    def _relief(self, m: PatchMeasures) -> float:
        """Return the largest share of its limit that protrusion, depth or roughness takes, to somewhat beyond
        the tool.
        """
        limits, sure = self.limits, self._sure(m)
        return max(
            (m.wide_depth_m + sure) / limits.most_depth_m,
            (m.wide_protrusion_m + sure) / limits.most_protrusion_m,
            _excess(m.wide_rms_m, m.sigma_m) / limits.most_rms_m,
        )

    def sound_relief(self, m: PatchMeasures) -> float:
        """Return the larger share of its limit that protrusion or depth takes, points beside steps left
        out.
        """
        limits, sure = self.limits, self._sure(m)
        return max(
            (m.sound_depth_m + sure) / limits.most_depth_m,
            (m.sound_protrusion_m + sure) / limits.most_protrusion_m,
        )

    def sound_points(self, at: Array, normal: Array) -> Array:
        """Return the trusted points (n, 3) under a tool on `at` (3,) along the unit `normal` (3,); frame of
        the cloud, m.
        """
        window = self._window(at, self._ball)
        ball = kernels.in_ball(window.cloud.points, at, self._ball)
        ball = ball[window.trusted[ball]]
        across, height = kernels.across_and_height(window.cloud.points[ball], at, normal)
        return window.cloud.points[ball[(across < self._near) & (height < self._above)]]

    def hole_m(self, points: Array, at: Array, normal: Array) -> float:
        """Return the diameter of the largest circle under the tool without any of the points (n, 3), frame of
        the cloud, m; `at` and the unit `normal` are (3,).
        """
        return self._gaps(points, at, normal, self._near, 0.0)[1]

    def _strain(self, m: PatchMeasures) -> float:
        limits = self.limits
        return max(
            self._relief(m),
            # what lies beside a step counts double
            2.0 * m.doubtful_share / limits.most_doubt,
            limits.sigmas * m.normal_sigma_rad / limits.most_normal_rad,
            # a hole that begins beyond the tool counts less
            m.wide_hole_m / (1.25 * limits.most_hole_m),
        )

    def _restless(self, m: PatchMeasures) -> Finding | None:
        limits = self.limits
        pairs = (
            (Reason.RESTLESS, self._relief(m), limits.calm, ""),
            (Reason.STEP_NEAR, m.doubtful_share, limits.calm_doubt, ""),
            (Reason.STEREO_HOLE, m.wide_hole_m, limits.calm_hole_m, "m"),
            (Reason.NORMAL, limits.sigmas * m.normal_sigma_rad, limits.calm_normal_rad, "rad"),
        )
        over = [Finding(*one) for one in pairs if not one[1] <= one[2]]
        return over[0] if over else None

    def _sure(self, m: PatchMeasures) -> float:
        """Return what stereo's error may hide of the relief, metres; patches of 5 x 5 pixels share it."""
        return self.limits.sigmas * m.sigma_m / math.sqrt(max(1.0, m.points / 25.0))

    def _findings(self, m: PatchMeasures) -> tuple[Finding, ...]:
        limits, sure, rms = self.limits, self._sure(m), _excess(m.rms_m, m.sigma_m)
        hole_m = limits.most_hole_m if m.doubtful_share <= limits.calm_doubt else limits.calm_hole_m
        pairs = (
            (Reason.STEREO_SHARE, m.valid_share, limits.least_share, ""),
            (Reason.STEREO_HOLE, m.hole_m, min(hole_m, limits.most_hole_m), "m"),
            (Reason.STEP_NEAR, m.doubtful_share, limits.most_doubt, ""),
            (Reason.VIEW_ANGLE, m.view_angle_rad, limits.most_view_rad, "rad"),
            (Reason.OFF_ROCK, m.rock_share, limits.least_rock_share, ""),
            (Reason.EDGE, m.depth_m + sure, limits.most_depth_m, "m"),
            (Reason.PROTRUSION, m.protrusion_m + sure, limits.most_protrusion_m, "m"),
            (Reason.ROUGHNESS, rms, limits.most_rms_m, "m"),
            (Reason.CLEARANCE, m.beside_m, limits.most_beside_m, "m"),
            (Reason.NORMAL, limits.sigmas * m.normal_sigma_rad, limits.most_normal_rad, "rad"),
            (Reason.SLOPE, m.slope_rad + limits.sigmas * m.normal_sigma_rad, limits.most_slope_rad, "rad"),
        )
        least = (Reason.STEREO_SHARE, Reason.OFF_ROCK)
        return tuple(
            Finding(reason, value, limit, unit)
            for reason, value, limit, unit in pairs
            if (value < limit if reason in least else not value <= limit)
        )


def _excess(rms_m: float, sigma_m: float) -> float:
    """Return the roughness without stereo's own."""
    return math.sqrt(max(0.0, rms_m**2 - sigma_m**2))


def _angle(a: Array, b: Array) -> float:
    return math.acos(float(np.clip(a @ b, -1.0, 1.0)))
