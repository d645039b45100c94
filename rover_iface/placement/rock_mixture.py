"""Ground and rocks as a mixture: the turns of expectation and maximisation.

What is a rock, and how its points are told from ground, is in `segmentation`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.ground_plane import GroundPlane, GroundSurface, fit_surface
from rover_iface.placement.point_graph import Index, adjacency, neighbours, raster_step, renumbered, touching
from rover_iface.placement.rock_segments import RockSegment, Segmentation
from rover_iface.placement.segmentation_options import SegmentationOptions

T = TypeVar("T", np.float64, np.int64)

STIFFER = 10.0
"""How much stiffer the ground is before any rock is known."""


class Mixture:
    """The state of expectation and maximisation."""

    def __init__(self, cloud: SurfaceCloud, plane: GroundPlane, options: SegmentationOptions) -> None:
        self.cloud, self.plane, self.options = cloud, plane, options
        self.local = plane.local(cloud.points)
        self.sigma = cloud.sigma_along(plane.normal)
        self.roughness = options.roughness_m
        self.edges = neighbours(cloud)
        self.touching = touching(cloud, self.edges, options.jump)
        a, b = self.edges[self.touching].T
        self.starts, self.others, self.pull = adjacency(cloud, a, b, options.coupling)
        step = raster_step(cloud.pixels) if cloud.pixels is not None else 1
        self.patch = max(1.0, (options.patch_px / step) ** 2 if cloud.pixels is not None else 4.0)
        self.chance = np.zeros(len(cloud))
        self.ground = self._first_ground()

    # ---- ground

    def _first_ground(self) -> GroundSurface:
        """Return the surface through what is not high: points over it lose weight, points under it do not."""
        spread2 = self.sigma**2 + self.roughness**2
        weight = 1.0 / spread2
        ground = GroundSurface(self.plane, np.zeros((3, 3)), self.local[:, :2].min(axis=0), 1e3)
        # stiff at first, so that it does not follow a rock before that is known as one
        stiff = replace(self.options.ground, stiffness=STIFFER * self.options.ground.stiffness)
        for reach in (3.0, 2.0, 1.5, 1.5):
            over = (self.local[:, 2] - ground.height(self.local[:, :2])) / np.sqrt(spread2)
            trust = 1.0 / (1.0 + np.exp(np.clip(4.0 * (over - reach), -50, 50)))
            ground = fit_surface(self.plane, self.local, weight * trust, stiff)
        return ground

    def _heights(self) -> Array:
        return np.asarray(self.local[:, 2] - self.ground.height(self.local[:, :2]))

    def _fit_ground(self) -> None:
        spread2 = self.sigma**2 + self.roughness**2
        self.ground = fit_surface(
            self.plane, self.local, np.maximum(1.0 - self.chance, 1e-6) / spread2, self.options.ground
        )
        height = self._heights()
        level = (1.0 - self.chance) * (np.abs(height) < 4.0 * np.sqrt(spread2))
        excess = float((level * (height**2 - self.sigma**2)).sum() / max(level.sum(), 1.0))
        low, high = 0.5 * self.options.roughness_m, 2.0 * self.options.roughness_m
        self.roughness = float(np.clip(math.sqrt(max(excess, 0.0)), low, high))

    # ---- rocks

    def _regions(self, rock: npt.NDArray[np.bool_]) -> Index:
        """Return (n,) the number of the connected region of each rock point, -1 elsewhere."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        joined = self.edges[self.touching]
        joined = joined[rock[joined].all(axis=1)]
        n = len(rock)
        graph = coo_matrix((np.ones(len(joined), np.int8), (joined[:, 0], joined[:, 1])), shape=(n, n))
        number = connected_components(graph, directed=False)[1].astype(np.int64)
        number[~rock] = -1
        return renumbered(number)

    def _kept(self, label: Index, height: Array) -> Index:
        """Return the labels without regions that are too small, too low, or no better than ground."""
        count = int(label.max(initial=-1)) + 1
        if count == 0:
            return label
        at = label >= 0
        points = np.bincount(label[at], minlength=count)
        gain = self._gains(label, height, count)
        # the fifth-highest point in a hundred: a single wrong match makes no rock
        tall = np.array([np.quantile(part, 0.95) for part in _parts(label, height, count)])
        wide = np.array([_width(part, self.local) for part in _parts(label, np.arange(len(label)), count)])
        keep = (points >= self.options.least_points) & (tall >= self.options.least_height_m) & (gain > 0.0)
        keep &= tall >= self.options.least_steepness * wide
        return renumbered(np.where(at & keep[np.maximum(label, 0)], label, -1))

    def _gains(self, label: Index, height: Array, count: int) -> Array:
        """Return (count,) by how much each rock beats ground on its points, less the cost of 6 parameters."""
        at = label >= 0
        better = self._log_rock(label, height, count)[at] - self._log_ground(height)[at]
        patch = self.patch
        points = np.bincount(label[at], minlength=count)
        total = np.bincount(label[at], weights=better, minlength=count) / patch
        return np.asarray(total - 0.5 * 6.0 * np.log(np.maximum(points / patch, math.e)))

    # ---- likelihoods of heights, per metre

    def _log_ground(self, height: Array) -> Array:
        spread2 = self.sigma**2 + self.roughness**2
        normal = np.exp(-0.5 * height**2 / spread2) / np.sqrt(2.0 * math.pi * spread2)
        # one point in fifty is a pebble or a wrong match
        return np.asarray(np.log(0.98 * normal + 0.02 / 0.5))

    def _log_rock(self, label: Index, height: Array, count: int) -> Array:
        """Return (n,) log density of heights as part of the rock: uniform from ground to top, blurred."""
        tops = np.full(count + 1, 0.15)
        for k, part in enumerate(_parts(label, height, count)):
            tops[k] = max(float(np.quantile(part, 0.98)), self.options.least_height_m)
        return self._log_uniform(height, tops[label])

    def _log_uniform(self, height: Array, top: Array) -> Array:
        from scipy.special import ndtr

        spread = np.hypot(self.sigma, 0.4 * self.roughness)
        inside = ndtr(height / spread) - ndtr((height - top) / spread)
        return np.asarray(np.log(np.maximum(inside / top, 1e-9) + 1e-4))

    # ---- the turns

    def run(self) -> Segmentation:
        height = self._heights()
        spread = np.sqrt(self.sigma**2 + self.roughness**2)
        start = height > np.maximum(self.options.start_sigma * spread, 0.6 * self.options.least_height_m)
        label = self._kept(self._regions(start), height)
        self.chance = (label >= 0).astype(np.float64)
        turn, likelihood = 0, -math.inf
        while turn < self.options.rounds:
            turn += 1
            self._fit_ground()
            height = self._heights()
            likelihood = self._expect(label, height)
            after = self._kept(self._regions(self.chance > 0.5), height)
            changed = float(((after >= 0) != (label >= 0)).mean())
            label = after
            self.chance = np.where((self.chance > 0.5) & (label < 0), 0.0, self.chance)
            if changed < 1e-3:
                break
        label, rocks = self._rocks(self._parted(label, height), height)
        return Segmentation(label, self.chance, height, rocks, self.ground, self.roughness, likelihood, turn)

    def _expect(self, label: Index, height: Array) -> float:
        """Set the chance of each point to be rock; return the log-likelihood, each patch counted once."""
        from rover_iface.placement.segmentation_kernels import mean_field

        prior, top = self._footprints(label, height)
        rock, ground = self._log_uniform(height, top), self._log_ground(height)
        odds = rock - ground + np.log(prior / (1.0 - prior))
        odds += self._appearance(label)
        mean_field(odds, self.starts, self.others, self.pull, self.chance, 4)
        total = np.logaddexp(np.log(prior) + rock, np.log(1.0 - prior) + ground).sum()
        return float(total / self.patch)

    def _appearance(self, label: Index) -> Array:
        """Return log-odds (n,) of the brightness of points near a rock, by histograms of it and of the ground
        round it; zero elsewhere and for clouds without brightness.
        """
        n = len(label)
        out = np.zeros(n)
        count = int(label.max(initial=-1)) + 1
        if self.cloud.intensity is None or not self.options.appearance or not count:
            return out
        bins = 24
        shade = np.minimum((np.sqrt(self.cloud.intensity) * bins).astype(np.int64), bins - 1)
        assert self.cloud.pixels is not None
        pixels = self.cloud.pixels
        order = np.lexsort((pixels[:, 0], pixels[:, 1]))
        lines = pixels[order, 1]
        for members in _parts(label, np.arange(n), count):
            low, high = pixels[members].min(axis=0), pixels[members].max(axis=0)
            margin = np.maximum(6, (0.4 * (high - low)).astype(np.int64))
            first, last = np.searchsorted(lines, (low[1] - margin[1], high[1] + margin[1] + 1))
            band = order[first:last]
            aside = pixels[band, 0]
            near = band[(aside >= low[0] - margin[0]) & (aside <= high[0] + margin[0])]
            rock = near[label[near] == label[members[0]]]
            around = near[label[near] < 0]
            one, two = (_histogram(shade[part], bins) for part in (rock, around))
            mine = near[(label[near] == label[members[0]]) | (label[near] < 0)]
            out[mine] = self.options.appearance * (np.log(one) - np.log(two))[shade[mine]]
        return out

    def _footprints(self, label: Index, height: Array) -> tuple[Array, Array]:
        """Return for each point the chance to be rock by place alone, and the height of the rock there."""
        n = len(label)
        prior = np.full(n, self.options.rock_share * 0.3)
        top = np.full(n, 0.15)
        count = int(label.max(initial=-1)) + 1
        if count == 0:
            return prior, top
        for members in _parts(label, np.arange(n), count):
            xy = self.local[members, :2]
            middle = xy.mean(axis=0)
            spread = np.cov(xy.T) + 1e-4 * np.eye(2)
            reach = 2.2 * math.sqrt(float(np.linalg.eigvalsh(spread)[-1]))
            near = np.flatnonzero((np.abs(self.local[:, :2] - middle) < reach + 0.05).all(axis=1))
            away = self.local[near, :2] - middle
            distance = np.sqrt(np.einsum("ni,ij,nj->n", away, np.linalg.inv(spread), away))
            inside = 1.0 / (1.0 + np.exp(np.clip(8.0 * (distance - 2.0), -40, 40)))
            chance = self.options.rock_share * 0.3 + (0.6 - self.options.rock_share * 0.3) * inside
            better = chance > prior[near]
            prior[near[better]] = chance[better]
            top[near[better]] = max(float(np.quantile(height[members], 0.98)), self.options.least_height_m)
        return prior, top

    def _parted(self, label: Index, height: Array) -> Index:
        """Return the labels with regions parted at saddles between summits; slivers join what they touch."""
        from rover_iface.placement.segmentation_kernels import part_at_saddles

        if not (label >= 0).any():
            return label
        smooth = np.where(label >= 0, height, 0.0)
        for _ in range(4):
            smooth = self._averaged(smooth, label)
        order = np.flatnonzero(label >= 0)
        order = order[np.argsort(-smooth[order], kind="stable")].astype(np.int64)
        deep = np.maximum(self.options.saddle_m, self.options.saddle_share * np.maximum(smooth, 0.0))
        deep = np.maximum(deep, 2.0 * self.sigma)
        group = np.empty(len(label), np.int64)
        part_at_saddles(smooth, self.starts, self.others, order, deep, group)
        parts = renumbered(group)
        small = np.bincount(parts[order]) < 2 * self.options.least_points
        back = (parts >= 0) & small[np.maximum(parts, 0)]
        # the largest part of each region takes its slivers
        size = np.bincount(parts[order])
        largest: dict[int, int] = {}
        for old, new in zip(label[order].tolist(), parts[order].tolist(), strict=True):
            if old not in largest or size[new] > size[largest[old]]:
                largest[old] = new
        owner = np.array([largest[k] for k in range(int(label.max()) + 1)])
        parts[back] = owner[label[back]]
        return renumbered(parts)

    def _averaged(self, values: Array, label: Index) -> Array:
        """Return the mean of each point and its neighbours of the same label."""
        a, b = self.edges[self.touching].T
        same = (label[a] == label[b]) & (label[a] >= 0)
        a, b = a[same], b[same]
        total = values + np.bincount(a, values[b], len(values)) + np.bincount(b, values[a], len(values))
        return np.asarray(
            total / (1.0 + np.bincount(a, minlength=len(values)) + np.bincount(b, minlength=len(values)))
        )

    def _rocks(self, label: Index, height: Array) -> tuple[Index, tuple[RockSegment, ...]]:
        count = int(label.max(initial=-1)) + 1
        if count == 0:
            return label, ()
        gain = self._gains(label, height, count)
        eye = self.cloud.eye if self.cloud.eye is not None else self.plane.origin
        found = []
        for k, members in enumerate(_parts(label, np.arange(len(label)), count)):
            found.append((k, members, self.cloud.points[members].mean(axis=0)))
        found.sort(key=lambda item: float(np.linalg.norm(item[2] - eye)))
        order = np.full(count + 1, -1)
        rocks = []
        for number, (k, members, centroid) in enumerate(found):
            order[k] = number
            local = self.local[members]
            away = local[:, :2] - local[:, :2].mean(axis=0)
            axes = np.linalg.eigh(away.T @ away)[1]
            size = np.ptp(away @ axes, axis=0)[::-1]
            rocks.append(
                RockSegment(
                    number,
                    centroid,
                    (float(size[0]), float(size[1])),
                    float(np.quantile(height[members], 0.98)),
                    self._outline(local[:, :2]),
                    len(members),
                    float(gain[k]),
                )
            )
        return order[label], tuple(rocks)

    def _outline(self, along: Array) -> Array:
        from scipy.spatial import ConvexHull, QhullError

        try:
            corners = along[ConvexHull(along).vertices]
        except QhullError:  # all in a line
            order = np.argsort(along @ np.ptp(along, axis=0))
            corners = along[order[[0, -1]]]
        foot = np.column_stack((corners, self.ground.height(corners)))
        return self.plane.points_of(foot)


def _parts(label: Index, values: npt.NDArray[T], count: int) -> list[npt.NDArray[T]]:
    """Return the values of each label 0..count-1."""
    at = np.flatnonzero(label >= 0)
    order = at[np.argsort(label[at], kind="stable")]
    cuts = np.cumsum(np.bincount(label[at], minlength=count))[:-1]
    return np.split(values[order], cuts)


def _width(members: Index, local: Array) -> float:
    """Return the smaller extent of points along the plane: four deviations."""
    if len(members) < 3:
        return 0.0
    return 4.0 * math.sqrt(max(0.0, float(np.linalg.eigvalsh(np.cov(local[members, :2].T))[0])))


def _histogram(values: Index, bins: int) -> Array:
    """Return shares (bins,) of a histogram, smoothed over its neighbours, none of them zero."""
    count = np.bincount(values, minlength=bins).astype(np.float64)
    smooth = np.convolve(count, (0.25, 0.5, 0.25), mode="same") + 0.02 * count.sum() / bins + 1e-3
    return np.asarray(smooth / smooth.sum())
