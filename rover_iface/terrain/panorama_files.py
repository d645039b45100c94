"""Files of the pictures that a terrain was made from, which go where the terrain goes."""

from __future__ import annotations

from pathlib import Path

from mission.codec import read_object
from rover_iface.errors import TerrainFormatError
from rover_iface.terrain.outside import inside


def panorama_files(folder: Path, name: str = "panorama.json") -> tuple[Path, ...]:
    """Return the files of a panorama in a folder, its document first; they are read when somebody looks.

    Raises
    ------
    TerrainFormatError
        If one is not in the folder.
    """
    document = inside(folder, name)
    listing = read_object(document, TerrainFormatError)
    wedges = listing.get("wedges")
    try:
        images = [wedge[side]["image"] for wedge in wedges or () for side in ("left", "right")]
    except (KeyError, TypeError) as err:
        raise TerrainFormatError(f"panorama {document} names no pictures: {err}") from err
    files = (document, *(inside(folder, str(image)) for image in images))
    for file in files:
        if not file.is_file():
            raise TerrainFormatError(f"panorama {document}: {file.name} does not exist")
    return files


def copied_panorama(files: tuple[Path, ...], folder: Path) -> str | None:
    """Bring the files of a panorama into a terrain's folder and return the name of its document, if any."""
    for file in files:
        if file.parent.resolve() != folder.resolve():
            (folder / file.name).write_bytes(file.read_bytes())
    return files[0].name if files else None
