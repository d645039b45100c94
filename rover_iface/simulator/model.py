"""The world of the abstract rover: a planning problem as plain arrays, and one future of it.

The problem is a JSON document `contingency/1`, `problem/1` or `problem/2`. Places are numbered 0 = start,
then the targets in order; observations in the order of the targets. This room reads the document by itself:
it never sees the planner.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mission.codec import Document
from mission.instrument import Use
from rover_iface.behaviour.target import DesignatedTarget
from rover_iface.errors import WorldError
from rover_iface.frames import Pose
from rover_iface.profile import RoverProfile

Array = NDArray[np.floating]
START = "start"
UPWARD = 0.0, 0.0, 1.0
"""Normal of a target of which no other is known."""
UNIT = 1e-3
"""By which the length of a normal may differ from 1: documents round to five digits."""
PROBLEM_FORMATS = ("contingency/1", "problem/1", "problem/2")

MOST_SOL_KINDS = 12
"""Kinds of sols that `problem/2` may state."""

ROUNDING = 1e-9
"""Chance below which nothing is left for a kind: chances that sum to 1 are written with sixteen digits."""


@dataclass(frozen=True, slots=True)
class ModelObservation:
    """One observation: which place it is made from, how it is carried out, and what must go before."""

    id: str
    place: int
    contact: bool
    needs_track: bool
    instrument: str
    p_success: float
    time_s: tuple[float, float]
    energy_j: tuple[float, float]
    data_mbit: float = 0.0
    before: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class SolOdds:
    """Kinds of sols by `name`, of which one is drawn and hidden: the chance `p` of each, what it multiplies
    times and energies of drives with, and all energies. What is left of the chances is the ordinary sol's.
    """

    name: tuple[str, ...] = ()
    p: tuple[float, ...] = ()
    drive_time: tuple[float, ...] = ()
    drive_energy: tuple[float, ...] = ()
    energy: tuple[float, ...] = ()

    def chance(self, k: int) -> float:
        """Return the chance of kind k where the sol is of none before it."""
        left = 1.0 - math.fsum(self.p[:k])
        return min(1.0, self.p[k] / left) if left > ROUNDING else 1.0

    def kind(self, u: Array) -> int | None:
        """Return the first kind k of which `u[k]` is less than its chance; None for the ordinary sol.

        `u` [MOST_SOL_KINDS] is uniform between 0 and 1.
        """
        return next((k for k in range(len(self.p)) if u[k] < self.chance(k)), None)

    def factors(self, u: Array) -> tuple[float, float, float]:
        """Return the factors on times and energies of drives and on other energies of the kind that such
        numbers `u` [MOST_SOL_KINDS] draw.
        """
        k = self.kind(u)
        if k is None:
            return 1.0, 1.0, 1.0
        return self.drive_time[k], self.drive_energy[k] * self.energy[k], self.energy[k]


@dataclass(frozen=True, eq=False)
class AbstractModel:
    """A planning problem as the abstract rover lives in it; `(mean, sd)` pairs are log-normal, sd 0 =
    constant.

    `leg_time_s[a, b]`, `leg_energy_j[a, b]` are [n+1, n+1, 2] with NaN where there is no leg; `p_lose[a, b,
    i]` is the chance to lose tracked target i on that leg, `p_fail[a, b]` that this drive fails.
    """

    name: str
    targets: tuple[str, ...]
    points: tuple[tuple[float, float, float] | None, ...]
    normals: tuple[tuple[float, float, float], ...]
    poses: tuple[Pose | None, ...]
    observations: tuple[ModelObservation, ...]
    leg_time_s: Array
    leg_energy_j: Array
    p_lose: Array
    p_fail: Array
    routes: Mapping[tuple[int, int], tuple[tuple[float, float], ...]]
    hotel_w: float
    battery_j: float
    track_time_s: float
    track_energy_j: float
    track_overhead_s: float
    sols: SolOdds

    @property
    def index(self) -> dict[str, int]:
        """Return place numbers by target id."""
        return {target: k + 1 for k, target in enumerate(self.targets)}

    @cached_property
    def spreads(self) -> tuple[LogNormal, LogNormal, LogNormal, LogNormal]:
        """Return the distributions of leg times, leg energies, observation times, observation energies."""
        m = len(self.observations)
        times = np.array([o.time_s for o in self.observations], dtype=float).reshape(m, 2)
        energies = np.array([o.energy_j for o in self.observations], dtype=float).reshape(m, 2)
        tables = (self.leg_time_s, self.leg_energy_j, times, energies)
        return tuple(LogNormal.of(table) for table in tables)  # type: ignore[return-value]  # four of them

    @staticmethod
    def from_problem(document: Mapping[str, object]) -> AbstractModel:
        """Return the model of a problem document.

        Raises
        ------
        WorldError
            If the format is unknown or a member is missing or malformed.
        """
        form = document.get("format")
        if form not in PROBLEM_FORMATS:
            known = ", ".join(f'"{name}"' for name in PROBLEM_FORMATS)
            raise WorldError(f'problem: "format" is {form!r}; readable are {known}')
        try:
            return _read(document, legacy=form == "contingency/1")
        except (KeyError, TypeError, ValueError, AttributeError, IndexError) as err:
            raise WorldError(f"problem {document.get('name')!r}: malformed member: {err!r}") from err


@dataclass(frozen=True, eq=False)
class Future:
    """What will happen, whatever is done: one row of a table of draws.

    Places as in `AbstractModel`. A tracked target i is lost on the leg a -> b iff `leg_loss_u[a, b, i]` is
    less than its chance, the drive fails iff `leg_fail_u[a, b]` is less than its own; observation k succeeds
    iff `obs_success_u[k]` is less than its probability. Amounts are as they come out on this kind of sol;
    `energy_factor` [1] is that of the kind on the hotel load and on the starts of tracks.
    """

    leg_time_s: Array
    leg_energy_j: Array
    leg_loss_u: Array
    leg_fail_u: Array
    obs_time_s: Array
    obs_energy_j: Array
    obs_success_u: Array
    energy_factor: Array

    @staticmethod
    def from_arrays(table: Any, model: AbstractModel) -> Future:
        """Return a future from arrays: a mapping or any object with these names, a leading axis of 1 allowed.

        `leg_fail_u` may be absent where no drive of the problem can fail, `energy_factor` where all sols are
        of one kind.

        Raises
        ------
        WorldError
            If an array is missing or has another shape than the problem.
        """
        n, m = len(model.targets) + 1, len(model.observations)
        shapes = {
            "leg_time_s": (n, n),
            "leg_energy_j": (n, n),
            "leg_loss_u": (n, n, n),
            "leg_fail_u": (n, n),
            "obs_time_s": (m,),
            "obs_energy_j": (m,),
            "obs_success_u": (m,),
            "energy_factor": (1,),
        }
        needless = {"leg_fail_u": not model.p_fail.any(), "energy_factor": not model.sols.p}
        arrays = {}
        for name, shape in shapes.items():
            value = table.get(name) if isinstance(table, Mapping) else getattr(table, name, None)
            if value is None and needless.get(name, False):
                value = np.ones(shape)
            if value is None:
                raise WorldError(f'table of draws: "{name}" is missing')
            array = np.asarray(value, dtype=float)
            if array.shape == (1, *shape):
                array = array[0]
            if array.shape != shape:
                raise WorldError(
                    f'table of draws: "{name}" has shape {array.shape}; the problem needs {shape}'
                )
            arrays[name] = array
        return Future(**arrays)

    @staticmethod
    def draw(model: AbstractModel, seed: int) -> Future:
        """Return one future drawn from the distributions of the problem; the same for the same seed.

        Durations are whole milliseconds, energies whole thousandths of a joule.
        """
        return Noise.draw(model, seed).future(model)


@dataclass(frozen=True, eq=False)
class Noise:
    """What chance gives to one future, apart from the problem's odds: standard normal numbers behind times
    and energies, uniform ones behind losses, failures, successes and kinds of sols (`sol_u`
    [MOST_SOL_KINDS]). Other arrays as in `Future`.

    Two problems with the same places and observations that are given the same noise share their future.
    """

    leg_time_z: Array
    leg_energy_z: Array
    leg_loss_u: Array
    leg_fail_u: Array
    obs_time_z: Array
    obs_energy_z: Array
    obs_success_u: Array
    sol_u: Array

    @staticmethod
    def draw(model: AbstractModel, seed: int) -> Noise:
        """Return the noise of a seed; each array has a stream of its own."""
        n, m = len(model.targets) + 1, len(model.observations)
        streams = [np.random.default_rng([seed, k]) for k in range(8)]
        return Noise(
            streams[0].standard_normal((n, n)),
            streams[1].standard_normal((n, n)),
            streams[2].random((n, n, n)),
            streams[6].random((n, n)),
            streams[3].standard_normal(m),
            streams[4].standard_normal(m),
            streams[5].random(m),
            streams[7].random(MOST_SOL_KINDS),
        )

    def future(self, model: AbstractModel) -> Future:
        """Return what comes of it in a problem."""
        spread = model.spreads
        drive_time, drive_energy, energy = model.sols.factors(self.sol_u)
        return Future(
            spread[0].amounts(self.leg_time_z, drive_time),
            spread[1].amounts(self.leg_energy_z, drive_energy),
            self.leg_loss_u,
            self.leg_fail_u,
            spread[2].amounts(self.obs_time_z),
            spread[3].amounts(self.obs_energy_z, energy),
            self.obs_success_u,
            np.array([energy]),
        )


@dataclass(frozen=True, eq=False)
class LogNormal:
    """Log-normal amounts: `middle` and `spread` are mean and standard deviation of the logarithm."""

    middle: Array
    spread: Array
    positive: NDArray[np.bool_]

    @staticmethod
    def of(mean_sd: Array) -> LogNormal:
        """Return the distribution with means and deviations `[..., 2]`; NaN counts as 0."""
        mean, sd = np.nan_to_num(mean_sd[..., 0]), np.nan_to_num(mean_sd[..., 1])
        safe = np.where(mean > 0, mean, 1.0)
        spread = np.sqrt(np.log1p((sd / safe) ** 2))
        return LogNormal(np.log(safe) - spread**2 / 2, spread, mean > 0)

    def amounts(self, z: Array, factor: float = 1.0) -> Array:
        """Return amounts [...] times a factor, rounded to thousandths, for standard normal numbers [...] in
        the unit of the means.
        """
        return np.round(np.where(self.positive, factor * np.exp(self.middle + self.spread * z), 0.0), 3)


def _amount(value: Document) -> tuple[float, float]:
    return float(value["mean"]), float(value.get("sd", 0.0))


def _sol_odds(document: Document) -> SolOdds:
    """Return the kinds of sols that a problem document states."""
    kinds = document.get("sol_kinds") or ()

    def factors(name: str) -> tuple[float, ...]:
        return tuple(1.0 if kind.get(name) is None else float(kind[name]) for kind in kinds)

    return SolOdds(
        tuple(str(kind["name"]) for kind in kinds),
        tuple(float(kind["p"]) for kind in kinds),
        factors("drive_time_factor"),
        factors("drive_energy_factor"),
        factors("energy_factor"),
    )


def _point(value: Sequence[float] | None) -> tuple[float, float, float] | None:
    if value is None:
        return None
    x, y, *rest = (float(v) for v in value)
    return x, y, rest[0] if rest else 0.0


def _unit(value: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in value)
    length = math.hypot(x, y, z)
    if not abs(length - 1.0) <= UNIT:
        raise ValueError(f"the normal ({x:g}, {y:g}, {z:g}) has a length of {length:g}; it must be 1")
    return x / length, y / length, z / length


def _pose(value: Any) -> Pose | None:
    if value is None:
        return None
    if isinstance(value, Mapping):
        return Pose(
            float(value["east_m"]), float(value["north_m"]), 0.0, float(value.get("heading_rad", 0.0))
        )
    return Pose(float(value[0]), float(value[1]))


def _read(document: Document, *, legacy: bool) -> AbstractModel:
    targets: list[str] = []
    points: list[tuple[float, float, float] | None] = []
    normals: list[tuple[float, float, float]] = []
    poses: list[Pose | None] = [_pose(document.get("start")) or Pose(0.0, 0.0)]
    raw: list[tuple[str, int, Document]] = []
    for place, target in enumerate(document["targets"], start=1):
        targets.append(str(target["id"]))
        points.append(_point(target.get("target_m" if legacy else "point_m", target.get("point_m"))))
        normals.append(_unit(target.get("normal") or UPWARD))
        poses.append(_pose(target.get("observation_point_m" if legacy else "observation_point")))
        entries = [dict(target)] if legacy else target["observations"]
        raw += [(str(entry["id"]), place, entry) for entry in entries]
    names = {name: k for k, (name, _, _) in enumerate(raw)}
    before: dict[int, list[int]] = {}
    for first, second in document.get("precedence", ()):
        before.setdefault(names[second], []).append(names[first])
    observations = tuple(
        ModelObservation(
            id=name,
            place=place,
            contact=entry["kind"] == "place",
            needs_track=entry["kind"] == "place" or entry.get("tracked") is True,
            instrument=str(entry.get("instrument", "")),
            p_success=float(entry.get("p_success", 1.0)),
            time_s=_amount(entry["observe"]["time_s"]),
            energy_j=_amount(entry["observe"]["energy_j"]),
            data_mbit=float(entry.get("data_mbit", 0.0)),
            before=tuple(before.get(k, ())),
        )
        for k, (name, place, entry) in enumerate(raw)
    )
    index = {START: 0, **{target: k + 1 for k, target in enumerate(targets)}}
    n = len(index)
    leg_time = np.full((n, n, 2), np.nan)
    leg_energy = np.full((n, n, 2), np.nan)
    p_lose = np.zeros((n, n, n))
    p_fail = np.zeros((n, n))
    routes: dict[tuple[int, int], tuple[tuple[float, float], ...]] = {}
    for leg in document["legs"]:
        a, b = index[leg["from"]], index[leg["to"]]
        leg_time[a, b] = _amount(leg["time_s"])
        leg_energy[a, b] = _amount(leg["energy_j"])
        p_fail[a, b] = float(leg.get("p_fail") or 0.0)
        for target, chance in leg.get("p_lose", {}).items():
            p_lose[a, b, index[target]] = float(chance)
        if leg.get("route"):
            routes[a, b] = tuple((float(p[0]), float(p[1])) for p in leg["route"])
    start = document["track_start"]
    return AbstractModel(
        name=str(document.get("name", "")),
        targets=tuple(targets),
        points=tuple(points),
        normals=tuple(normals),
        poses=tuple(poses),
        observations=observations,
        leg_time_s=leg_time,
        leg_energy_j=leg_energy,
        p_lose=p_lose,
        p_fail=p_fail,
        routes=routes,
        hotel_w=float(document["hotel_w"]),
        battery_j=float(document["budget"]["energy_j"]),
        track_time_s=float(start["time_s"]),
        track_energy_j=float(start["energy_j"]),
        track_overhead_s=float(document["track_overhead_s_per_leg"]),
        sols=_sol_odds(document),
    )


def problem_from_targets(
    targets: Sequence[DesignatedTarget], profile: RoverProfile, start: Pose, *, loss_per_m: float = 0.004
) -> Mapping[str, object]:
    """Return a `problem/2` document for targets with observation points, with times from a rover profile.

    It serves worlds that come without a planning problem: legs are straight lines, each target has one
    observation with the first instrument of the rover that fits (contact where `kind` is "place").
    """
    drive, overhead = profile.activity("navigate"), profile.activity("track_overhead")
    begin = profile.activity("trackstart")
    places: list[tuple[str, float, float]] = [(START, start.x, start.y)]
    listed = []
    for target in targets:
        stand = target.observation_point or Pose(target.point[0], target.point[1])
        places.append((target.id, stand.x, stand.y))
        instrument = profile.usual_instrument(Use.CONTACT if target.kind == "place" else Use.REMOTE)
        figures = profile.instrument(instrument)
        listed.append(
            {
                "id": target.id,
                "point_m": list(target.point),
                "normal": list(target.normal),
                "observation_point": {"east_m": stand.x, "north_m": stand.y, "heading_rad": stand.heading},
                "observations": [
                    {
                        "id": f"{target.id}-{instrument}",
                        "instrument": instrument,
                        "kind": target.kind,
                        "utility": 1.0,
                        "p_success": figures.p_success,
                        "observe": {"time_s": asdict(figures.time_s), "energy_j": asdict(figures.energy_j)},
                    }
                ],
            }
        )
    legs = []
    for a, ax, ay in places:
        for b, bx, by in places[1:]:
            if a == b:
                continue
            length = math.hypot(bx - ax, by - ay)
            time, energy = drive.time_s(length), drive.energy_j(length)
            lost = 1.0 - math.exp(-loss_per_m * length)
            legs.append(
                {
                    "from": a,
                    "to": b,
                    "length_m": length,
                    "time_s": asdict(time),
                    "energy_j": asdict(energy),
                    "p_lose": {t[0]: lost for t in places[1:]},
                }
            )
    return {
        "format": "problem/2",
        "name": "targets",
        "start": {"east_m": start.x, "north_m": start.y, "heading_rad": start.heading},
        "budget": {
            "time_s": 14400.0,
            "energy_j": profile.power.initial_j,
            "energy_floor_j": profile.power.floor_j,
        },
        "hotel_w": profile.power.hotel_w,
        "track_start": {"time_s": begin.fixed_s, "energy_j": begin.fixed_j},
        "track_overhead_s_per_leg": overhead.fixed_s,
        "targets": listed,
        "legs": legs,
    }
