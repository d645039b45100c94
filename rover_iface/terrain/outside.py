"""Limits of files from outside: where their names may lead, and how many pixels they may open to."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING

from rover_iface.errors import TerrainFormatError

if TYPE_CHECKING:
    from PIL.Image import Image

MAX_PIXELS = 128_000_000
"""Posts of a DEM and pixels of an image: a HiRISE DEM of 8 x 16 km at 1 m, half a GB of heights."""


def require_size(what: str, columns: int, rows: int) -> None:
    """Raise `TerrainFormatError` if a raster is larger than is read."""
    if columns * rows > MAX_PIXELS:
        raise TerrainFormatError(f"{what} has {columns} x {rows} pixels; at most {MAX_PIXELS} are read")


def inside(folder: Path, name: str) -> Path:
    """Return the path of a file that a description in the folder names.

    Raises
    ------
    TerrainFormatError
        If the name leads outside the folder.
    """
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\\" in name or "\0" in name:
        raise TerrainFormatError(f"{folder} names the file {name[:80]!r}, which lies outside the folder")
    return folder / path


@contextmanager
def opened_image(path: Path, what: str) -> Iterator[Image]:
    """Give an image whose pixels are not read yet.

    Raises
    ------
    TerrainFormatError
        If it is none, is damaged, or is larger than is read.
    """
    from PIL import Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path) as image:
                require_size(f"{what} {path}", *image.size)
                yield image
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as err:
        raise TerrainFormatError(f"{what} {path}: {err}") from err
