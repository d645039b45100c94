"""The panorama of the start pose: the pictures that its terrain was made from, or what the simulator renders.

Tiles are made when they are asked for, kept on disk, and asked for points.
"""

from __future__ import annotations

import hashlib
import math
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from sqlalchemy import select

from ground.day.rovers import profile_of
from ground.errors import InvalidInputError, NotFoundError, OutsideTerrainError
from ground.gdr.geometry import Pose as PoseValue
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import mission_terrain, terrain_row
from ground.resources.site_views.taken_pictures import TakenPictures
from ground.resources.site_views.value import Panorama, PanoramaTile
from ground.resources.sols.row import SolRow
from ground.resources.terrains.terrain import ground_at
from ground.resources.terrains.value import TerrainPoint

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from rover_iface.cameras.model import CameraModel
    from rover_iface.cameras.rig import CameraRig
    from rover_iface.frames import Pose
    from rover_iface.profile import RoverProfile
    from rover_iface.simulator.render.renderer import Renderer
    from rover_iface.terrain import Terrain

TILT_RAD = -0.26
OVERLAP = 0.1
SIGHT_M = 100.0
VERSION = 3
"""Part of the name of a stored tile: another way of rendering is another name."""

_rendering = threading.Lock()
_renderer: tuple[str, Renderer] | None = None


@dataclass(frozen=True, slots=True)
class _Asked:
    """What a mission says of its panorama: the ground, the rover, where and when its last sol starts."""

    terrain: Terrain
    sha256: str
    profile: RoverProfile
    start: PoseValue
    lmst_h: float


@dataclass(frozen=True)
class _Place:
    """Where a panorama is taken, by what, and in which light."""

    key: str
    folder: Path
    terrain: Terrain
    start: PoseValue
    stands: Pose
    rig: CameraRig
    camera: str
    lmst_h: float
    count: int

    def model(self, index: int) -> CameraModel:
        """Return the camera of a tile, site frame: the mast makes up for the slope the rover stands on."""
        heading = self.stands.heading + math.pi - math.tau * (index + 0.5) / self.count
        level = math.cos(TILT_RAD)
        site_from_rover = self.stands.site_from_rover
        ahead, left, up = site_from_rover.rotation.T @ (
            level * math.cos(heading),
            level * math.sin(heading),
            math.sin(TILT_RAD),
        )
        pan, tilt = math.atan2(left, ahead), math.asin(max(-1.0, min(1.0, up)))
        return self.rig.camera(self.camera, pan, tilt).transformed(site_from_rover)

    def left_azimuth(self, index: int) -> float:
        """Return the azimuth (clockwise from north) of a tile's left edge, 0 to 2 pi."""
        heading = self.stands.heading + math.pi - math.tau * index / self.count
        return (math.pi / 2 - heading) % math.tau

    def tile(self, index: int) -> Path:
        return self.folder / f"{index}.jpg"


@dataclass(frozen=True, slots=True)
class _Shape:
    width: int
    height: int
    top_rad: float
    step_rad: float


def look_around(repo: Repository, actor: Actor, mission_id: str) -> Panorama:
    """Return the panorama of a mission's start pose; its tiles are rendered when they are read.

    Raises
    ------
    OutsideTerrainError
        If the rover cannot stand at its start.
    """
    asked = _asked(repo, actor, mission_id)
    if (taken := _taken(repo, asked)) is not None:
        return taken.describe(mission_id)
    place = _place(repo, asked)
    shape = _shape(place)
    return Panorama(
        pose=place.start,
        camera=place.camera,
        lmst_h=place.lmst_h,
        tile_width=shape.width,
        tile_height=shape.height,
        top_elevation_rad=shape.top_rad,
        rad_per_px=shape.step_rad,
        tiles=[
            PanoramaTile(
                index=k,
                left_azimuth_rad=place.left_azimuth(k),
                eye_m=[float(c) for c in place.model(k).C],
                ready=place.tile(k).exists(),
                url=f"/api/v1/missions/{mission_id}/panorama/tiles/{k}?key={place.key}",
            )
            for k in range(place.count)
        ],
    )


def read_tile(repo: Repository, actor: Actor, mission_id: str, index: int) -> Path:
    """Return the image of a tile, rendered now if nobody has asked for it before.

    Raises
    ------
    NotFoundError
        If the panorama has no such tile.
    """
    asked = _asked(repo, actor, mission_id)
    if (taken := _taken(repo, asked)) is not None:
        _require_tile(index, taken.tiles)
        return taken.tile(index)
    place = _place(repo, asked)
    _require_tile(index, place.count)
    path = place.tile(index)
    if path.exists():
        return path
    with _rendering:
        if not path.exists():
            _render(place, index)
            if all(place.tile(k).exists() for k in range(place.count)):
                _forget()
    return path


def point_in_panorama(
    repo: Repository, actor: Actor, mission_id: str, azimuth_rad: float, elevation_rad: float
) -> TerrainPoint:
    """Return the ground that a direction of the panorama looks at, from the full-resolution terrain.

    Raises
    ------
    OutsideTerrainError
        If the line of sight meets no ground within 100 m.
    """
    asked = _asked(repo, actor, mission_id)
    if (taken := _taken(repo, asked)) is not None:
        return taken.point(azimuth_rad, elevation_rad)
    place = _place(repo, asked)
    offset = (azimuth_rad - place.left_azimuth(0)) % math.tau
    index = min(place.count - 1, int(offset / (math.tau / place.count)))
    level = math.cos(elevation_rad)
    ray = (level * math.sin(azimuth_rad), level * math.cos(azimuth_rad), math.sin(elevation_rad))
    hit = place.terrain.intersect_rays(place.model(index).C, ray, SIGHT_M)
    if math.isnan(hit[0]):
        raise OutsideTerrainError(
            f"the line of sight at azimuth {math.degrees(azimuth_rad) % 360:.1f}, elevation "
            f"{math.degrees(elevation_rad):.1f} degrees meets no ground within {SIGHT_M:g} m",
            pointer="/elevation_rad",
        )
    return ground_at(place.terrain, float(hit[0]), float(hit[1]), place.start)


def _require_tile(index: int, count: int) -> None:
    if index >= count:
        raise NotFoundError(f"the panorama has no tile {index}; it has 0 to {count - 1}")


def _asked(repo: Repository, actor: Actor, mission_id: str) -> _Asked:
    actor.require(Action.READ, mission_id)
    with repo.database.read() as session:
        ground = terrain_row(session, mission_id)
        profile = profile_of(session.get_one(MissionRow, mission_id).rover_profile)
        sol = session.scalars(
            select(SolRow).where(SolRow.mission_id == mission_id).order_by(SolRow.number.desc()).limit(1)
        ).first()
        start = PoseValue(**(ground.description["start_pose"] if sol is None else sol.start_pose))
        lmst_h = 10.0 if sol is None else float(sol.start_lmst_h)
        return _Asked(mission_terrain(repo, session, mission_id), ground.sha256, profile, start, lmst_h)


def _taken(repo: Repository, asked: _Asked) -> TakenPictures | None:
    cache = repo.data_dir / "cache" / "panoramas"
    return TakenPictures.of(asked.terrain, asked.start, cache, asked.sha256, asked.lmst_h)


def _place(repo: Repository, asked: _Asked) -> _Place:
    from rover_iface.cameras.rig import rig_of
    from rover_iface.mobility import settled_pose

    terrain, profile, start, lmst_h = asked.terrain, asked.profile, asked.start, asked.lmst_h
    stands = settled_pose(terrain, profile, start.east_m, start.north_m, start.heading_rad)
    if math.isnan(stands.z):
        raise OutsideTerrainError(
            f"the rover cannot stand at its start ({start.east_m:.2f}, {start.north_m:.2f}): the ground "
            "there is not known",
            pointer="/start_pose",
        )
    text = f"{VERSION} {asked.sha256} {profile.sha256} {start} {lmst_h:.3f}"
    key = hashlib.sha256(text.encode()).hexdigest()[:20]
    rig = rig_of(profile)
    camera = profile.cameras.navigation
    count = max(1, math.ceil(math.tau / (_field(rig.mounted(camera).model) * (1.0 - OVERLAP))))
    folder = repo.data_dir / "cache" / "panoramas" / key
    return _Place(key, folder, terrain, start, stands, rig, camera, lmst_h, count)


def _field(model: CameraModel) -> float:
    """Return the horizontal field of view, radians."""
    import numpy as np

    middle = model.height / 2.0
    edges = model.back_project(np.array([[0.0, middle], [model.width - 1.0, middle]]))[1]
    return math.acos(float(np.clip(edges[0] @ edges[1], -1, 1)))


def _shape(place: _Place) -> _Shape:
    """Return the size of the tiles: all of each is inside its camera's frame, as fine as the camera sees."""
    import numpy as np

    span = math.tau / place.count
    tops: list[float] = []
    bottoms: list[float] = []
    for index in range(place.count):
        model = place.model(index)
        across = np.linspace(0.0, model.width - 1.0, 65)
        for line, limits, worst in ((0.0, tops, np.min), (model.height - 1.0, bottoms, np.max)):
            rays = model.back_project(np.stack([across, np.full_like(across, line)], axis=-1))[1]
            turned = np.arctan2(rays[:, 0], rays[:, 1]) - place.left_azimuth(index) - span / 2
            inside = np.abs(np.remainder(turned + math.pi, math.tau) - math.pi) <= span / 2
            limits.append(float(worst(np.arcsin(np.clip(rays[inside, 2], -1.0, 1.0)))))
    top, bottom = min(tops), max(bottoms)
    width = max(16, round(span * place.rig.mounted(place.camera).model.hs))
    step = span / width
    return _Shape(width, max(16, int((top - bottom) / step)), top, step)


def _render(place: _Place, index: int) -> None:
    """Render one camera frame and lay it out as a cylinder's part."""
    import cv2
    import numpy as np
    from PIL import Image

    from mission import Sky
    from rover_iface.errors import RoverError
    from rover_iface.simulator.render.renderer import Sun

    clock = Sky(start_lmst_h=place.lmst_h).clock()
    model = place.model(index)
    try:
        frame = _eye(place).render(
            model,
            None,
            Sun(clock.direction(0.0)),
            sensor=place.rig.mounted(place.camera).sensor,
            seed=index,
        )
    except RoverError as err:
        raise InvalidInputError(f"the panorama cannot be rendered: {err}") from err
    shape = _shape(place)
    rays = tile_rays(place.left_azimuth(index), shape.top_rad, shape.step_rad, shape.width, shape.height)
    pixels = model.project(model.C + 1e3 * rays).astype(np.float32)
    flat = cv2.remap(
        frame.image8,
        np.nan_to_num(pixels[..., 0], nan=-1.0),
        np.nan_to_num(pixels[..., 1], nan=-1.0),
        cv2.INTER_LINEAR,
    )
    place.folder.mkdir(parents=True, exist_ok=True)
    draft = place.tile(index).with_suffix(".draft")
    Image.fromarray(flat).save(draft, "JPEG", quality=88)
    draft.replace(place.tile(index))


def tile_rays(
    left_azimuth_rad: float, top_elevation_rad: float, step_rad: float, width: int, height: int
) -> npt.NDArray[np.float64]:
    """Return unit rays [height, width, 3] of a tile's pixels, site frame."""
    import numpy as np

    azimuth = left_azimuth_rad + (np.arange(width) + 0.5) * step_rad
    elevation = top_elevation_rad - (np.arange(height) + 0.5) * step_rad
    level = np.cos(elevation)[:, None]
    return np.stack(
        (
            level * np.sin(azimuth),
            level * np.cos(azimuth),
            np.broadcast_to(np.sin(elevation)[:, None], (height, width)),
        ),
        axis=-1,
    )


def _eye(place: _Place) -> Renderer:
    """Return the renderer of a place; the last one is kept while its panorama has tiles to render."""
    global _renderer
    if _renderer is None or _renderer[0] != place.key:
        from rover_iface.simulator.render.from_terrain import scene_from_terrain
        from rover_iface.simulator.render.renderer import Renderer

        scene = scene_from_terrain(place.terrain, (place.start.east_m, place.start.north_m), radius_m=14.0)
        _renderer = (place.key, Renderer(scene))
    return _renderer[1]


def _forget() -> None:
    global _renderer
    _renderer = None
