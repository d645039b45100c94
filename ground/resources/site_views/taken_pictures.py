"""The pictures that a terrain was made from, as the panorama of the place they were taken from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING
from uuid import uuid4

from ground.errors import OutsideTerrainError
from ground.gdr.geometry import Pose
from ground.resources.site_views.value import Panorama, PanoramaTile
from ground.resources.terrains.terrain import ground_at
from ground.resources.terrains.value import TerrainPoint

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from rover_iface.cameras.panorama import Panorama as Pictures
    from rover_iface.terrain import Terrain

TILE_PX = 1024
WIDEST_PX = 8_192
"""Of a full circle, 0.77 mrad a pixel: a mosaic finer than that takes longer to load than anybody looks at
it."""

SAME_PLACE_M = 0.5
"""How far a sol may start from where the pictures were taken and still have them as its panorama."""

CAMERA = "pictures"


@dataclass(frozen=True, slots=True)
class TakenPictures:
    """The pictures of a terrain, laid out as a strip.

    `folder` is where its tiles are kept.
    """

    terrain: Terrain
    start: Pose
    folder: Path
    lmst_h: float

    @staticmethod
    def of(terrain: Terrain, start: Pose, cache: Path, sha256: str, lmst_h: float) -> TakenPictures | None:
        """Return the pictures of a terrain if it has some and a sol starts where they were taken."""
        if not terrain.panorama or math.hypot(start.east_m, start.north_m) > SAME_PLACE_M:
            return None
        return TakenPictures(terrain, start, cache / f"pictures-{sha256[:20]}", lmst_h)

    def describe(self, mission_id: str) -> Panorama:
        """Return the strip: all its tiles are there."""
        mosaic = _mosaic(self._files)
        key = self.folder.name
        return Panorama(
            pose=self.start,
            camera=CAMERA,
            lmst_h=self.lmst_h,
            tile_width=TILE_PX,
            tile_height=mosaic.height,
            top_elevation_rad=mosaic.top_rad,
            rad_per_px=mosaic.step_rad,
            tiles=[
                PanoramaTile(
                    index=k,
                    left_azimuth_rad=(mosaic.left_rad + k * TILE_PX * mosaic.step_rad) % math.tau,
                    eye_m=[float(c) for c in mosaic.pictures.eye],
                    ready=True,
                    url=f"/api/v1/missions/{mission_id}/panorama/tiles/{k}?key={key}",
                )
                for k in range(mosaic.tiles)
            ],
        )

    @property
    def tiles(self) -> int:
        """Return how many tiles the strip has."""
        return _mosaic(self._files).tiles

    def tile(self, index: int) -> Path:
        """Return the image of a tile, cut out now if nobody has asked for it before."""
        from PIL import Image

        path = self.folder / f"{index}.jpg"
        if not path.exists():
            mosaic = _mosaic(self._files)
            cut = Image.fromarray(mosaic.image).crop(
                (index * TILE_PX, 0, (index + 1) * TILE_PX, mosaic.height)
            )
            self.folder.mkdir(parents=True, exist_ok=True)
            draft = path.with_suffix(f".{uuid4().hex}.draft")
            cut.save(draft, "JPEG", quality=88)
            draft.replace(path)
        return path

    def point(self, azimuth_rad: float, elevation_rad: float) -> TerrainPoint:
        """Return the ground in a direction: ranged in the two pictures there, and the terrain's where both
        agree.

        Raises
        ------
        OutsideTerrainError
            If no picture shows it, its pair does not range it, or the terrain has no height there or another
            one.
        """
        from rover_iface.errors import CameraError

        try:
            match = _mosaic(self._files).pictures.pick(azimuth_rad, elevation_rad)
        except CameraError as err:
            raise OutsideTerrainError(str(err), pointer="/elevation_rad") from err
        east, north, up = (float(c) for c in match.point)
        found = ground_at(self.terrain, east, north, self.start)
        sigma = float(self.terrain.sigma(east, north))
        known = 0.0 if math.isnan(sigma) else sigma
        # what the pick is off along its ray shows as a height on slopes and on rocks: one post of
        # it is allowed
        limit = 3.0 * math.hypot(known, math.sqrt(float(match.covariance[2, 2]))) + self.terrain.spacing
        if abs(found.up_m - up) > limit:
            raise OutsideTerrainError(
                f"the pictures range the point at ({east:.2f}, {north:.2f}) {up:.2f} m up, the terrain is "
                f"{found.up_m:.2f} m up there; they may differ by {limit:.2f} m: it is hidden, or overhangs",
                pointer="/elevation_rad",
            )
        return found

    @property
    def _files(self) -> tuple[Path, ...]:
        return self.terrain.panorama


@dataclass(frozen=True, slots=True)
class _Mosaic:
    pictures: Pictures
    image: npt.NDArray[np.uint8]
    left_rad: float
    top_rad: float
    step_rad: float

    @property
    def height(self) -> int:
        rows: int = self.image.shape[0]
        return rows

    @property
    def tiles(self) -> int:
        columns: int = self.image.shape[1]
        return columns // TILE_PX


@lru_cache(maxsize=2)
def _mosaic(files: tuple[Path, ...]) -> _Mosaic:
    """Return the pictures in the folder of a panorama's document, and their mosaic, as fine as they are."""
    import numpy as np

    from rover_iface.cameras.panorama import load_panorama

    pictures = load_panorama(files[0].parent)
    finest = max(wedge.left_camera.hs for wedge in pictures.wedges)
    image, edges = pictures.cut_mosaic(min(WIDEST_PX, round(math.tau * finest)))
    step = edges["rad_per_px"]
    # edges count to the middles of the first pixels, tiles to their outer corner
    left, top = edges["left_azimuth_rad"] - step / 2, edges["top_elevation_rad"] + step / 2
    # the strip is whole tiles and is opened at its middle: what the pictures do not fill lies on both sides
    spare = -image.shape[1] % TILE_PX
    before = spare // 2
    image = np.pad(image, ((0, 0), (before, spare - before), *((0, 0),) * (image.ndim - 2)))
    return _Mosaic(pictures, image, left - before * step, top, step)
