"""Terrain: elevation, ortho image and rocks; loaded, generated, queried."""

from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.geology import GEOLOGIES, Geology, geology_named
from rover_iface.terrain.grid import HeightGrid, HeightLayer, Ortho
from rover_iface.terrain.landscape import Recipe
from rover_iface.terrain.load import load_terrain, write_terrain
from rover_iface.terrain.rocks import Mesh, Rock
from rover_iface.terrain.terrain import Terrain, stereo_covariance

__all__ = [
    "GEOLOGIES",
    "Geology",
    "HeightGrid",
    "HeightLayer",
    "Mesh",
    "Ortho",
    "Recipe",
    "Rock",
    "Terrain",
    "generate_terrain",
    "geology_named",
    "load_terrain",
    "stereo_covariance",
    "write_terrain",
]
