"""Tell which ground the mast camera sees from the start pose, and how well a point there is known."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING

from ground.gdr.geometry import Pose
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.resources.missions.read_terrain import HeightTile, step_within
from ground.resources.missions.terrain import mission_terrain, terrain_row
from ground.resources.terrains.terrain import BASELINE_M, CAMERA_HEIGHT_M, FOCAL_PX, SINK_M, layer_of

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from rover_iface.terrain import Terrain

UNKNOWN, HIDDEN, FIRST_SEEN = 0, 1, 2
"""Values of a post: nothing known there; not seen from the start; above that 2 + sigma in centimetres."""

RAYS = 1440
NEAR_M = 0.5


def read_coverage(
    repo: Repository, actor: Actor, mission_id: str, layer_name: str, max_posts: int
) -> HeightTile:
    """Return one byte a post, first row in the north: 0 unknown, 1 hidden, else 2 + sigma in centimetres.

    Sigma is the standard deviation along the worst axis of a point picked there in the stereo pair over the
    start pose (at most 253 cm).
    """
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        row = terrain_row(session, mission_id)
        start = Pose(**row.description["start_pose"])
        sha256 = row.sha256
        terrain = mission_terrain(repo, session, mission_id)
    layer_of(terrain, layer_name)
    return _coverage(_Key(terrain, sha256), start, layer_name, max_posts)


class _Key:
    """A terrain that is the same as another when its content is."""

    def __init__(self, terrain: Terrain, sha256: str) -> None:
        self.terrain, self.sha256 = terrain, sha256

    def __hash__(self) -> int:
        return hash(self.sha256)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and self.sha256 == other.sha256


@lru_cache(maxsize=8)
def _coverage(key: _Key, start: Pose, layer_name: str, max_posts: int) -> HeightTile:
    import numpy as np

    terrain = key.terrain
    layer = layer_of(terrain, layer_name)
    rows, columns = layer.heights.shape
    step = step_within(layer, max_posts)
    spacing = float(layer.spacing) * step
    x = float(layer.west) + spacing * np.arange(-(-columns // step))
    y = float(layer.south) + spacing * np.arange(-(-rows // step))
    east, north = np.meshgrid(x, y)
    base = float(terrain.height(start.east_m, start.north_m))
    eye = (start.east_m, start.north_m, (0.0 if math.isnan(base) else base) + CAMERA_HEIGHT_M)
    away = np.hypot(east - eye[0], north - eye[1])
    seen = _seen(terrain, eye, east, north, away)
    sigma_cm = 100.0 * _sigma(eye, away)
    code = np.where(seen, np.clip(np.rint(sigma_cm), 0, 253) + FIRST_SEEN, HIDDEN)
    code = np.where(terrain.observed(east, north) & np.isfinite(terrain.height(east, north)), code, UNKNOWN)
    content = np.ascontiguousarray(code[::-1], dtype=np.uint8).tobytes()
    bounds = (float(x[0]), float(y[0]), float(x[-1]), float(y[-1]))
    return HeightTile(len(y), len(x), spacing, bounds, content)


def _seen(
    terrain: Terrain,
    eye: tuple[float, float, float],
    east: npt.NDArray[np.float64],
    north: npt.NDArray[np.float64],
    away: npt.NDArray[np.float64],
) -> npt.NDArray[np.bool_]:
    """Return which posts nothing hides: along each of 1,440 rays a post is seen while its elevation rises.

    A post may lie 1 cm under the line of sight before it counts as hidden.
    """
    import numpy as np

    stride = max(terrain.spacing, 0.05)
    radii = np.arange(NEAR_M, float(away.max()) + stride, stride)
    azimuth = np.arange(RAYS) * (2.0 * math.pi / RAYS)
    x = eye[0] + radii[:, None] * np.cos(azimuth)
    y = eye[1] + radii[:, None] * np.sin(azimuth)
    slope = (terrain.height(x, y) - eye[2]) / radii[:, None]
    horizon = np.maximum.accumulate(np.nan_to_num(slope, nan=-np.inf), axis=0)
    clear = slope >= horizon - SINK_M / radii[:, None]
    ring = np.clip(np.rint((away - NEAR_M) / stride).astype(np.int64), 0, len(radii) - 1)
    ray = np.rint(np.arctan2(north - eye[1], east - eye[0]) / (2.0 * math.pi / RAYS)).astype(np.int64) % RAYS
    found: npt.NDArray[np.bool_] = clear[ring, ray]
    return found


def _sigma(eye: tuple[float, float, float], away: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the largest standard deviation of a picked point by its distance, metres."""
    import numpy as np

    from rover_iface.terrain import stereo_covariance

    far = np.geomspace(0.3, max(1.0, float(away.max())), 48)
    worst = [
        math.sqrt(
            float(
                np.linalg.eigvalsh(
                    stereo_covariance(
                        eye,
                        (eye[0] + d, eye[1], eye[2] - CAMERA_HEIGHT_M),
                        focal_px=FOCAL_PX,
                        baseline_m=BASELINE_M,
                    )
                )[-1]
            )
        )
        for d in far
    ]
    return np.interp(away, far, worst)
