"""Geologies: which families of rocks lie on a ground, of what colour, how much bedrock lies open, and where
wind has laid sand.

A geology dresses the rocks of a landscape: places and diameters stay those of the law of Golombek and Rapp
(1997), family, height, colour, dust and burial are its own. Plates of bedrock are rocks too, with sides that
fit those of their neighbours, so stereo, placement, wheels and maps meet them as triangles like any other.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType

import numpy as np

from rover_iface.errors import TerrainFormatError
from rover_iface.streams import stream
from rover_iface.terrain.rock_shapes import Family
from rover_iface.terrain.rocks import Rock
from rover_iface.terrain.surface import Surface

HEIGHTS: Mapping[Family, tuple[float, float]] = MappingProxyType(
    {
        "boulder": (0.32, 0.74),
        "slab": (0.10, 0.28),
        "block": (0.20, 0.52),
        "layered": (0.16, 0.45),
        "ventifact": (0.18, 0.42),
        "rounded": (0.25, 0.55),
    }
)
"""Height above ground over diameter, least and most; `boulder` as on a site without a geology, the others by
eye beside the real frames: a slab is one by being flat."""


@dataclass(frozen=True, slots=True)
class AlbedoFamily:
    """Rocks of one kind of stone: mean albedo, its spread, and their share among the families."""

    mean: float
    spread: float
    weight: float = 1.0

    def __post_init__(self) -> None:
        if not (0.03 <= self.mean <= 0.6 and 0 <= self.spread <= 0.2 and self.weight > 0):
            raise TerrainFormatError(
                f"albedo family {self.mean} +- {self.spread} of weight {self.weight}: a mean of 0.03 to 0.6, "
                "a spread of 0 to 0.2 and a positive weight are possible"
            )


@dataclass(frozen=True, slots=True)
class Geology:
    """How the rocks and the bedrock of a place look.

    Attributes
    ----------
    families
        Weight of each family of loose rocks.
    stones
        Kinds of stone by their albedo.
    dust
        Least and most of what faces up that lies under dust.
    pavement, plate_m, plate_albedo
        Share of the middle of the site where bedrock lies open in plates, how wide these are, and their
        albedo. An outcrop of the recipe is plates all over.
    buried
        Share of the recipe's loose rocks that lie under sand altogether, 0..1.
    surface
        What lies below the size of rocks; its `wind_rad` is drawn for each site.
    """

    name: str
    families: Mapping[Family, float]
    stones: tuple[AlbedoFamily, ...]
    dust: tuple[float, float] = (0.1, 0.7)
    pavement: float = 0.0
    plate_m: float = 0.5
    plate_albedo: AlbedoFamily = field(default_factory=lambda: AlbedoFamily(0.30, 0.02))
    buried: float = 0.0
    surface: Surface = field(default_factory=Surface)

    def __post_init__(self) -> None:
        unknown = [name for name in self.families if name not in HEIGHTS]
        if unknown:
            raise TerrainFormatError(
                f"geology {self.name}: rock family {unknown[0]!r} is not known; "
                f"there are {', '.join(HEIGHTS)}"
            )
        if not self.families or min(self.families.values()) < 0 or sum(self.families.values()) <= 0:
            raise TerrainFormatError(f"geology {self.name}: weights of families are {dict(self.families)}")
        if not self.stones:
            raise TerrainFormatError(f"geology {self.name} has no albedo family")
        if not 0 <= self.dust[0] <= self.dust[1] <= 1:
            raise TerrainFormatError(f"geology {self.name}: dust is {self.dust}; 0 to 1, rising, is possible")
        for what, share in (("pavement", self.pavement), ("buried", self.buried)):
            if not 0 <= share <= 1:
                raise TerrainFormatError(f"geology {self.name}: {what} is {share}; 0 to 1 is possible")
        if not 0.2 <= self.plate_m <= 3:
            raise TerrainFormatError(
                f"geology {self.name}: plates are {self.plate_m} m wide; 0.2 to 3 m are possible"
            )


def _surface(name: str, **values: float) -> Surface:
    """Return a surface with the blotches of the sandy look, a slope between its and the default's, and rocks
    smoother than others'.
    """
    usual = {
        "soil_slope": 0.13,
        "soil_mottle": 0.4,
        "gravel_mottle": 0.8,
        "stone_slope": 0.04,
        "mottle": 0.05,
    }
    return Surface(name, **(usual | values))


GEOLOGIES: Mapping[str, Geology] = MappingProxyType(
    {
        each.name: each
        for each in (
            Geology(
                "gusev",
                {"block": 0.35, "ventifact": 0.3, "slab": 0.15, "layered": 0.1, "rounded": 0.1},
                (AlbedoFamily(0.16, 0.02, 0.3), AlbedoFamily(0.22, 0.02, 0.4), AlbedoFamily(0.33, 0.03, 0.3)),
                surface=_surface(
                    "gusev",
                    banks=0.6,
                    stones_per_m2=20.0,
                    stone_power=4.0,
                    gravel=0.5,
                    sand=0.65,
                    grain=0.12,
                    ripples=0.06,
                ),
            ),
            Geology(
                "meridiani",
                {"slab": 0.45, "block": 0.3, "layered": 0.2, "rounded": 0.05},
                (AlbedoFamily(0.30, 0.03, 0.6), AlbedoFamily(0.17, 0.02, 0.4)),
                pavement=0.4,
                plate_albedo=AlbedoFamily(0.33, 0.03),
                surface=_surface(
                    "meridiani",
                    banks=0.5,
                    stones_per_m2=20.0,
                    stone_power=5.0,
                    gravel=0.55,
                    sand=0.4,
                    grain=0.3,
                    ripples=0.04,
                ),
            ),
            Geology(
                "gale",
                {"block": 0.45, "slab": 0.3, "layered": 0.2, "rounded": 0.05},
                (AlbedoFamily(0.21, 0.02, 0.5), AlbedoFamily(0.27, 0.03, 0.5)),
                pavement=0.25,
                plate_m=0.4,
                plate_albedo=AlbedoFamily(0.26, 0.03),
                surface=_surface(
                    "gale",
                    banks=0.3,
                    stones_per_m2=130.0,
                    stone_power=1.8,
                    gravel=0.6,
                    sand=0.3,
                    grain=0.05,
                    soil_slope=0.28,
                    ripples=0.0,
                ),
            ),
            Geology(
                "jezero",
                {"block": 0.4, "ventifact": 0.3, "rounded": 0.3},
                (AlbedoFamily(0.18, 0.02, 0.5), AlbedoFamily(0.25, 0.03, 0.5)),
                buried=0.8,
                surface=_surface(
                    "jezero",
                    banks=0.5,
                    stones_per_m2=15.0,
                    stone_power=5.0,
                    gravel=0.55,
                    sand=0.5,
                    grain=0.3,
                    soil_slope=0.08,
                    soil_mottle=0.2,
                    ripples=0.05,
                ),
            ),
        )
    }
)
"""Grounds after those of Spirit, Opportunity, Curiosity and Perseverance, set by eye and by the classifier of
`studies/picture_page.py` beside the frames of each and terrains of seeds 71 to 79: rocks are darker and
lighter than the soil's 0.25 by about the ratios in these."""


def geology_named(name: str) -> Geology:
    """Return a geology by its name; `TerrainFormatError` names those that there are."""
    if name not in GEOLOGIES:
        raise TerrainFormatError(f"geology {name!r} is not known; there are {', '.join(GEOLOGIES)}")
    return GEOLOGIES[name]


def dressed(rocks: Sequence[Rock], kind: Geology, *, seed: int, wind_rad: float) -> tuple[Rock, ...]:
    """Return the rocks with family, height, colour, dust and burial of a geology; places and widths stay."""
    rng = stream("geology", seed)
    families = list(kind.families)
    weights = np.array([kind.families[family] for family in families], dtype=float)
    stones = np.array([stone.weight for stone in kind.stones])
    family = rng.choice(len(families), len(rocks), p=weights / weights.sum())
    stone = rng.choice(len(kind.stones), len(rocks), p=stones / stones.sum())
    share = rng.random((len(rocks), 5))
    gauss = rng.normal(size=(len(rocks), 2))
    made = []
    for rock, f, s, u, g in zip(rocks, family, stone, share, gauss, strict=True):
        if u[4] < kind.buried:
            continue
        name, of = families[f], kind.stones[s]
        low, high = HEIGHTS[name]
        # the wind grinds what stands in its way: a ventifact's x axis points to it
        yaw = wind_rad + 0.2 * float(g[1]) if name == "ventifact" else rock.yaw
        made.append(
            replace(
                rock,
                family=name,
                height=round(float(rock.diameter * (low + (high - low) * u[0])), 4),
                burial=round(float(0.15 + 0.45 * u[1]), 4),
                elongation=round(float(0.5 + 0.5 * u[3]), 4),
                yaw=round(yaw % math.tau, 4),
                albedo=round(float(np.clip(of.mean + of.spread * g[0], 0.04, 0.6)), 4),
                dust=round(float(kind.dust[0] + (kind.dust[1] - kind.dust[0]) * u[2]), 4),
            )
        )
    return tuple(made)
