"""What a simulated rover needs, the format `world/1`.

::

    {"format": "world/1", "name": "site-1",
     "terrain": "terrain",                  folder beside this file, or absent
     "profile": "k9",                       a name, or a TOML file beside this one
     "seed": 1,
     "start": {"east_m": 0, "north_m": 0, "heading_rad": 0},
     "targets": [{"id": "T1", "point_m": [3.1, 2.0, 0.4], "normal": [0, 0, 1], "kind": "place",
                  "observation_point": {"east_m": 2.5, "north_m": 1.6, "heading_rad": 0.7}}],
     "problem": "problem.json",             or the document itself; legs are made from the targets when absent
     "future": null,                        one future of the problem as arrays (abstract rover)
     "battery_j": 1350000,
     "soil": {"slip_per_slope": 0.9, "slip_flat": 0.03, "sinkage_m": 0.01},
     "map_error": {"unmapped_rocks_per_m2": 0.01, "softer": 1.2},
     "sun": {"ls_deg": 120, "latitude_deg": -4.6, "start_lmst_h": 10.0},
     "faults": [], "progress_s": 0,
     "progress_at_bends": false,            where motion changes alone, not so often (abstract rover)
     "tracker": "ncc"}                      the rover's own when absent

Every member but `format` may be absent or null. A problem document by itself is a world too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from mission import Sky
from mission.codec import Codec, Document, read_object
from mission.values import NotNegative, Point3, reads_over, value
from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.errors import WorldError
from rover_iface.frames import Pose
from rover_iface.profile import RoverProfile, load_profile
from rover_iface.simulator.faults import Fault, load_faults
from rover_iface.simulator.model import PROBLEM_FORMATS

if TYPE_CHECKING:
    from rover_iface.terrain.terrain import Terrain


@value
class Soil:
    """How the ground gives way: slip = flat + per_slope x sine of the slope uphill, a share of the path."""

    slip_flat: float = 0.02
    slip_per_slope: float = 0.9
    sinkage_m: float = 0.005


@value
class MapError:
    """How the true world differs from the map the planner had: rocks per square metre that are not on the
    map, and by what factor the soil slips more.
    """

    unmapped_rocks_per_m2: float = 0.0
    softer: float = 1.0


@reads_over
@value
class WorldStand:
    """Where the rover stands, of a world document."""

    east_m: float
    north_m: float
    heading_rad: float = 0.0

    def pose(self) -> Pose:
        """Return the pose as the rover takes it."""
        return Pose(self.east_m, self.north_m, 0.0, self.heading_rad)


@reads_over
@value
class WorldTarget:
    """A target of a world document."""

    id: str
    point_m: Point3
    normal: Point3 = (0.0, 0.0, 1.0)
    kind: Literal["place", "image"] = "place"
    observation_point: WorldStand | None = None

    def designated(self) -> DesignatedTarget:
        """Return the target as the rover takes it."""
        stand = None if self.observation_point is None else self.observation_point.pose()
        return DesignatedTarget(self.id, self.point_m, self.normal, self.kind, stand)


@value
class WorldFile:
    """What a `world/1` document holds; files are named as they lie beside it."""

    name: str = ""
    terrain: str | None = None
    profile: str = "k9"
    seed: int = 0
    start: WorldStand | None = None
    targets: tuple[WorldTarget, ...] = ()
    problem: str | Document | None = None
    future: str | Document | None = None
    battery_j: NotNegative | None = None
    soil: Soil = Soil()
    map_error: MapError = MapError()
    sun: Sky = Sky()
    faults: str | tuple[Fault, ...] = ()
    progress_s: NotNegative = 0.0
    progress_at_bends: bool = False
    tracker: str = ""


WORLDS = Codec(WorldFile, "world/1", "world", error=WorldError)


@dataclass(frozen=True, eq=False)
class World:
    """A simulated rover's world, read and checked."""

    name: str
    folder: Path
    profile: RoverProfile
    terrain: str | None = None
    seed: int = 0
    start: Pose = field(default_factory=lambda: Pose(0.0, 0.0))
    targets: tuple[DesignatedTarget, ...] = ()
    problem: Document | None = None
    future: Document | None = None
    battery_j: float | None = None
    soil: Soil = field(default_factory=Soil)
    map_error: MapError = field(default_factory=MapError)
    sun: Sky = field(default_factory=Sky)
    faults: tuple[Fault, ...] = ()
    progress_s: float = 0.0
    progress_at_bends: bool = False
    tracker: str = ""

    def problem_document(self) -> Mapping[str, object]:
        """Return the planning problem; made from the targets when the world has none."""
        if self.problem is not None:
            return self.problem
        from rover_iface.simulator.model import problem_from_targets

        return problem_from_targets(self.targets, self.profile, self.start)

    def load_terrain(self) -> Terrain | None:
        """Return the terrain of the world, or None if it has none.

        Raises
        ------
        TerrainFormatError
            If it cannot be read.
        """
        if self.terrain is None:
            return None
        from rover_iface.terrain.load import load_terrain

        return load_terrain(self.folder / self.terrain)


WorldSource = World | Mapping[str, object] | Path | str
"""A world, a `world/1` or problem document, its file, or a folder with `world.json`."""


def load_world(source: WorldSource) -> World:
    """Return a world.

    Raises
    ------
    WorldError
        If the file cannot be read, the format is unknown, or a member is unknown or malformed. Unknown
        members of targets and poses are read over, as they were when the first of these files were written.
    """
    if isinstance(source, World):
        return source
    folder, where, problem = Path(), "", None
    if isinstance(source, Path | str):
        path = Path(source)
        if path.is_dir():
            path = path / "world.json"
        folder, where = path.parent, str(path)
        source = read_object(path, WorldError, "world")
    if source.get("format") in PROBLEM_FORMATS:
        problem = source
        source = {"format": WORLDS.format, "name": str(source.get("name", "")), "start": source.get("start")}
    read = WORLDS.from_document({name: item for name, item in source.items() if item is not None}, where)
    problem = problem or _beside(folder, read.problem, "problem")
    start = read.start or _start_of(problem) or WorldStand(0.0, 0.0)
    return World(
        name=read.name or folder.name,
        folder=folder,
        profile=load_profile(folder / read.profile if read.profile.endswith(".toml") else read.profile),
        terrain=read.terrain,
        seed=read.seed,
        start=start.pose(),
        targets=tuple(target.designated() for target in read.targets),
        problem=problem,
        future=_beside(folder, read.future, "future"),
        battery_j=read.battery_j,
        soil=read.soil,
        map_error=read.map_error,
        sun=read.sun,
        faults=load_faults(folder / read.faults) if isinstance(read.faults, str) else read.faults,
        progress_s=read.progress_s,
        progress_at_bends=read.progress_at_bends,
        tracker=read.tracker,
    )


def _start_of(problem: Document | None) -> WorldStand | None:
    """Return where the rover stands at the start of a problem; None when it does not say."""
    if problem is None or problem.get("start") is None:
        return None
    return WORLDS.from_document({"format": WORLDS.format, "start": problem["start"]}).start


def _beside(folder: Path, named: str | Document | None, what: str) -> Document | None:
    return read_object(folder / named, WorldError, what) if isinstance(named, str) else named
