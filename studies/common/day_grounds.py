"""Grounds for days: generated ones, and those of Curiosity with rocks strewn by the seed."""

from __future__ import annotations

from pathlib import Path

from rover_iface.terrain import Terrain, generate_terrain, load_terrain
from rover_iface.terrain.strew import strew_rocks

GENERATED = "generated"
CURIOSITY = Path(__file__).parents[3] / "shared" / "data" / "terrain" / "msl_onsight"
STREWN_COVER = 0.07


def strewn(terrain: Terrain, seed: int) -> Terrain:
    """Return a real ground with rocks: its posts hold no detail at the scale of a tool."""
    return strew_rocks(
        terrain, seed=seed, half_m=14.0, total_cover=STREWN_COVER, keep_clear=((0.0, 0.0, 1.6),)
    )


def ground_of(name: str, seed: int) -> Terrain:
    """Return the ground of a day: `GENERATED`, or one of `curiosity_names`.

    Raises
    ------
    TerrainError
        If there is none of that name.
    """
    return generate_terrain(seed) if name == GENERATED else strewn(load_terrain(CURIOSITY / name), seed)


def curiosity_names() -> tuple[str, ...]:
    """Return the names of Curiosity's grounds, in order.

    Raises
    ------
    SystemExit
        If they are not there.
    """
    found = sorted(folder.name for folder in CURIOSITY.glob("*") if folder.is_dir())
    if not found:
        raise SystemExit(f"no grounds of Curiosity lie in {CURIOSITY}")
    return tuple(found)
