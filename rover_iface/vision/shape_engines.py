"""What refines a start of a registration: generalised ICP, and the published simplex search."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.frames import Transform
from rover_iface.vision import shape_kernels
from rover_iface.vision.sift_motion import small_rotation
from rover_iface.vision.surface import Sensor, ShapeOptions, Surface

if TYPE_CHECKING:
    from small_gicp import RegistrationResult

REACHES = (5.0, 2.5)
"""How far GICP looks for partners, in its voxels: first wide, then near."""
ITERATIONS, FIRST_ITERATIONS = 25, 8
LEAST_PARTNERS = 0.8
"""Share of the points that find a partner from the best start, below which another one is given up after the
first iterations: it leads off the surface, and searching there takes ten times as long."""


class Gicp:
    """Generalised ICP from a start, in two reaches.

    `centre` [3], m, is a point near both surfaces, in their frame.
    """

    def __init__(self, part: Surface, other: Surface, centre: Array, options: ShapeOptions) -> None:
        import small_gicp

        # numbers near zero: small-gicp's voxels count from the origin
        self.base = centre
        self.voxel_m = options.voxel_m
        (self.target, self.tree), (self.source, _) = (
            small_gicp.preprocess_points(
                surface.points - centre,
                downsampling_resolution=options.voxel_m,
                num_neighbors=options.neighbours,
                num_threads=1,
            )
            for surface in (other, part)
        )

    def __call__(self, start: Transform) -> Transform:
        return self._finish(self._begin(start))

    def all_of(self, starts: Sequence[Transform]) -> list[Transform]:
        """Return where starts lead, without those that leave the surface: few points find a partner there."""
        begun = [self._begin(start) for start in starts]
        most = max(b.num_inliers for b in begun)
        return [self._finish(b) for b in begun if b.num_inliers >= LEAST_PARTNERS * most]

    def _begin(self, start: Transform) -> RegistrationResult:
        """Return the first iterations, over the wide reach."""
        pose = np.eye(4)
        pose[:3, :3] = start.rotation
        pose[:3, 3] = start.translation + start.rotation @ self.base - self.base
        return self._align(pose, REACHES[0], FIRST_ITERATIONS)

    def _finish(self, begun: RegistrationResult) -> Transform:
        wide = begun
        if not begun.converged:
            wide = self._align(np.asarray(begun.T_target_source), REACHES[0], ITERATIONS - FIRST_ITERATIONS)
        pose = np.asarray(
            self._align(np.asarray(wide.T_target_source), REACHES[1], ITERATIONS).T_target_source
        )
        u, _, vt = np.linalg.svd(pose[:3, :3])
        rotation = u @ vt
        return Transform(rotation, pose[:3, 3] - rotation @ self.base + self.base)

    def _align(self, pose: Array, reach: float, iterations: int) -> RegistrationResult:
        import small_gicp

        return small_gicp.align(
            self.target,
            self.source,
            self.tree,
            pose,
            registration_type="GICP",
            max_correspondence_distance=reach * self.voxel_m,
            num_threads=1,
            max_iterations=iterations,
            translation_epsilon=1e-4,
            rotation_epsilon=1e-4,
        )


class NelderMead:
    """The published engine from a start: Nelder-Mead over six parameters, restarted twice.

    `centre` [3], m, is the point that turns are about, in the frame of the part.
    """

    def __init__(self, part: Surface, sensor: Sensor, centre: Array, options: ShapeOptions) -> None:
        self.points = np.ascontiguousarray(part.points[:: max(1, len(part.points) // 1500)])
        self.buffer = np.empty(len(self.points))
        self.sensor, self.centre, self.cap_m = sensor, centre, options.cap_m

    def all_of(self, starts: Sequence[Transform]) -> list[Transform]:
        """Return where starts lead."""
        return [self(start) for start in starts]

    def __call__(self, start: Transform) -> Transform:
        from scipy.optimize import minimize

        def motion(p: Array) -> Transform:
            place = np.asarray(start.apply(self.centre), dtype=np.float64)
            turn = small_rotation(p[3:])
            return Transform(turn, place - turn @ place + p[:3]) * start

        def cost(p: Array) -> float:
            local = self.sensor.sensor_from_site * motion(p)
            r, t = (np.ascontiguousarray(v, dtype=np.float64) for v in (local.rotation, local.translation))
            depth, focal = self.sensor.depth, self.sensor.focal
            return float(shape_kernels.deviations(self.points, r, t, depth, focal, self.cap_m, self.buffer))

        p = np.zeros(6)
        for size in (1.0, 0.5, 0.25):
            simplex = np.vstack((p, p + size * np.diag([0.02, 0.02, 0.02, 0.05, 0.05, 0.05])))
            options = {"initial_simplex": simplex, "maxfev": 250, "xatol": 2e-4, "fatol": 1e-6}
            p = np.asarray(minimize(cost, p, method="Nelder-Mead", options=options).x)
        return motion(p)
