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
     "tracker": "ncc"}                      the rover's own when absent

Every member but `format` may be absent. A problem document by itself is a world too.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mission import MissionError, Sky
from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.errors import WorldError
from rover_iface.frames import Pose
from rover_iface.profile import RoverProfile, load_profile
from rover_iface.simulator.faults import Fault, load_faults

if TYPE_CHECKING:
    from rover_iface.terrain.terrain import Terrain

FORMAT = "world/1"
_PROBLEMS = ("problem/1", "contingency/1")
_MEMBERS = {
    "format", "name", "terrain", "profile", "seed", "start", "targets", "problem", "future", "battery_j",
    "soil", "map_error", "sun", "faults", "progress_s", "tracker",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Soil:
    """How the ground gives way: slip = flat + per_slope x sine of the slope uphill, as a share of the way."""

    slip_flat: float = 0.02
    slip_per_slope: float = 0.9
    sinkage_m: float = 0.005


@dataclass(frozen=True, slots=True)
class MapError:
    """How the true world differs from the map the planner had: rocks per square metre that are not on the
    map, and by what factor the soil slips more.
    """

    unmapped_rocks_per_m2: float = 0.0
    softer: float = 1.0


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
    problem: Mapping[str, Any] | None = None
    future: Mapping[str, Any] | None = None
    battery_j: float | None = None
    soil: Soil = field(default_factory=Soil)
    map_error: MapError = field(default_factory=MapError)
    sun: Sky = field(default_factory=Sky)
    faults: tuple[Fault, ...] = ()
    progress_s: float = 0.0
    tracker: str = ""

    def problem_document(self) -> Mapping[str, Any]:
        """Return the planning problem; made from the targets when the world has none."""
        if self.problem is not None:
            return self.problem
        from rover_iface.simulator.model import problem_from_targets

        listed = [
            {
                "id": t.id,
                "point_m": list(t.point),
                "kind": t.kind,
                "observation_point": None
                if t.observation_point is None
                else {
                    "east_m": t.observation_point.x,
                    "north_m": t.observation_point.y,
                    "heading_rad": t.observation_point.heading,
                },
            }
            for t in self.targets
        ]
        return problem_from_targets(listed, self.profile, self.start)

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

        path = Path(self.terrain)
        return load_terrain(path if path.is_absolute() else self.folder / path)


def load_world(source: World | Mapping[str, Any] | Path | str) -> World:
    """Return a world from a `world/1` or problem document, its file, or a folder with `world.json`.

    Raises
    ------
    WorldError
        If the file cannot be read, the format is unknown, or a member is unknown or malformed.
    """
    if isinstance(source, World):
        return source
    folder = Path()
    if isinstance(source, Path | str):
        path = Path(source)
        if path.is_dir():
            path = path / "world.json"
        folder = path.parent
        source = _read_json(path, "world")
    form = source.get("format")
    if form in _PROBLEMS:
        start = _pose(source.get("start"), "start") or Pose(0.0, 0.0)
        return World(str(source.get("name", "")), folder, load_profile("k9"), problem=source, start=start)
    if form != FORMAT:
        raise WorldError(f'world: "format" is {form!r}; "{FORMAT}" or a planning problem is needed')
    unknown = set(source) - _MEMBERS
    if unknown:
        raise WorldError(f'world: unknown member "{sorted(unknown)[0]}"')
    profile = str(source.get("profile", "k9"))
    problem = source.get("problem")
    if isinstance(problem, str):
        problem = _read_json(folder / problem, "problem")
    future = source.get("future")
    if isinstance(future, str):
        future = _read_json(folder / future, "future")
    faults = source.get("faults", ())
    start = source.get("start", None if problem is None else problem.get("start"))
    return World(
        name=str(source.get("name", folder.name)),
        folder=folder,
        profile=load_profile(folder / profile if profile.endswith(".toml") else profile),
        terrain=None if source.get("terrain") is None else str(source["terrain"]),
        seed=int(_number(source, "seed", 0)),
        start=_pose(start, "start") or Pose(0.0, 0.0),
        targets=tuple(_target(item) for item in source.get("targets", ())),
        problem=problem,
        future=future,
        battery_j=None if source.get("battery_j") is None else _number(source, "battery_j", 0.0, minimum=0.0),
        soil=_values(Soil, source.get("soil"), "soil"),
        map_error=_values(MapError, source.get("map_error"), "map_error"),
        sun=_values(Sky, source.get("sun"), "sun"),
        faults=load_faults(folder / faults if isinstance(faults, str) else faults),
        progress_s=_number(source, "progress_s", 0.0, minimum=0.0),
        tracker=str(source.get("tracker") or ""),
    )


def _read_json(path: Path, what: str) -> Mapping[str, Any]:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as err:
        raise WorldError(f"{what} {path}: {err.strerror or err}") from err
    except ValueError as err:
        raise WorldError(f"{what} {path} is not JSON: {err}") from err
    if not isinstance(document, dict):
        raise WorldError(f"{what} {path} must be an object, found {document!r:.60}")
    return document


def _number(
    source: Mapping[str, Any], name: str, default: float, *, minimum: float = -math.inf, what: str = "world"
) -> float:
    value = source.get(name, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise WorldError(f'{what}: "{name}" must be a number, found {value!r:.60}')
    if value < minimum:
        raise WorldError(f'{what}: "{name}" is {value:g}; it must be at least {minimum:g}')
    return float(value)


def _values(kind: type[Any], value: Any, what: str) -> Any:
    if value is None:
        return kind()
    if not isinstance(value, Mapping):
        raise WorldError(f'world: "{what}" must be an object, found {value!r:.60}')
    unknown = set(value) - set(kind.__dataclass_fields__)
    if unknown:
        raise WorldError(f'world: "{what}" has the unknown member "{sorted(unknown)[0]}"')
    try:
        return kind(**{name: _number(value, name, 0.0, what=f'world: "{what}"') for name in value})
    except MissionError as err:
        raise WorldError(f'world: "{what}": {err}') from err


def _pose(value: Any, what: str) -> Pose | None:
    if value is None:
        return None
    if not isinstance(value, Mapping):
        raise WorldError(f'world: "{what}" must be an object with east_m and north_m, found {value!r:.60}')
    return Pose(
        _number(value, "east_m", math.nan, what=what),
        _number(value, "north_m", math.nan, what=what),
        0.0,
        _number(value, "heading_rad", 0.0, what=what),
    )


def _triple(value: Any, what: str) -> tuple[float, float, float]:
    if (
        not isinstance(value, list | tuple)
        or len(value) != 3
        or not all(isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in value)
    ):
        raise WorldError(f"{what} must hold three numbers, found {value!r:.60}")
    return float(value[0]), float(value[1]), float(value[2])


def _target(value: Any) -> DesignatedTarget:
    if not isinstance(value, Mapping) or not isinstance(value.get("id"), str):
        raise WorldError(f'world: a target must be an object with "id", found {value!r:.60}')
    what = f"target {value['id']}"
    kind = value.get("kind", "place")
    if kind not in ("place", "image"):
        raise WorldError(f'{what}: "kind" is {kind!r}; it must be "place" or "image"')
    return DesignatedTarget(
        id=value["id"],
        point=_triple(value.get("point_m"), f'{what}: "point_m"'),
        normal=_triple(value.get("normal", (0.0, 0.0, 1.0)), f'{what}: "normal"'),
        kind=kind,
        observation_point=_pose(value.get("observation_point"), f'{what}: "observation_point"'),
    )
