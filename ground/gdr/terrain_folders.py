"""Terrains in the data folder: the last few stay in memory once loaded."""

from __future__ import annotations

import threading
from collections import OrderedDict
from pathlib import Path
from typing import TYPE_CHECKING

from ground.errors import TerrainFileError

if TYPE_CHECKING:
    from rover_iface.terrain import Terrain


_KEPT = 4


_cache: OrderedDict[Path, Terrain] = OrderedDict()


_lock = threading.Lock()


def load_cached(folder: Path) -> Terrain:
    """Return the terrain in a folder; the last few stay in memory."""
    from rover_iface.errors import RoverError
    from rover_iface.terrain import load_terrain

    with _lock:
        terrain = _cache.get(folder)
        if terrain is None:
            try:
                terrain = load_terrain(folder)
            except RoverError as err:
                raise TerrainFileError(str(err)) from err
            _cache[folder] = terrain
            while len(_cache) > _KEPT:
                _cache.popitem(last=False)
        _cache.move_to_end(folder)
        return terrain
