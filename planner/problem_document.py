"""The documents `problem/2`, `problem/1` and `contingency/1` as types, read, checked and written by one
codec.

`contingency/1` holds one observation per target and is brought up to `problem/1`, its superset; in
`problem/2` drives may fail, the kind of sol may be hidden and successes of a day may go together. Members
that may be absent may also be null, but for those that are true or false.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, NotRequired, cast

from annotated_types import Ge, Le, MaxLen, MinLen
from typing_extensions import TypedDict  # pydantic asks for it before Python 3.12

from mission.codec import Codec, shown
from mission.values import Chance, NotNegative, Point3, Positive, Share, document
from planner.errors import ProblemError

MAX_TARGETS = 2_000
"""By hand: all pairs of so many are four million legs."""

MAX_SOL_KINDS = 12
"""By hand: a plan is valued, and a bound made, for each; nine are three of time by three of energy."""

Name = Annotated[str, MinLen(1)]
Pair = Annotated[tuple[float, ...], MinLen(2), MaxLen(2)]
Coordinates = Annotated[tuple[float, ...], MinLen(2), MaxLen(3)]
"""East, north and perhaps up in the site frame, metres."""
Factor = Annotated[float, Ge(0.1), Le(10)]
"""By hand: a sol ten times as slow, or as quick, as the amounts say is another problem."""


@document
class AmountDocument(TypedDict):
    """A random amount that may be 0."""

    mean: NotNegative
    sd: NotRequired[NotNegative | None]


@document
class PositiveDocument(TypedDict):
    """A random amount above 0."""

    mean: Positive
    sd: NotRequired[NotNegative | None]


@document
class ObserveDocument(TypedDict):
    """What making an observation takes: seconds, and joules beside the hotel load."""

    time_s: AmountDocument
    energy_j: AmountDocument


@document
class PoseDocument(TypedDict):
    """Where the rover stands in the site frame; heading counter-clockwise from east."""

    east_m: float
    north_m: float
    heading_rad: NotRequired[float | None]


class _Observed(TypedDict):
    kind: Literal["place", "image"]
    utility: NotNegative
    observe: ObserveDocument
    window_s: NotRequired[Pair | None]


@document
class ObservationDocument(_Observed):
    """One observation of a target."""

    id: Name
    instrument: NotRequired[str | None]
    action: NotRequired[str | None]
    p_success: NotRequired[Chance | None]
    must_do: NotRequired[bool]
    data_mbit: NotRequired[NotNegative | None]
    tracked: NotRequired[bool]
    refs: NotRequired[dict[str, str] | None]


@document
class SureTargetDocument(TypedDict):
    """A target with its observations."""

    id: Name
    point_m: NotRequired[Coordinates | None]
    observation_point: NotRequired[PoseDocument | None]
    diminishing: NotRequired[Share | None]
    refs: NotRequired[dict[str, str] | None]
    observations: tuple[ObservationDocument, ...]


@document
class TargetDocument(SureTargetDocument):
    """A target of which the outward normal of its surface is known, in the site frame; where nothing is said
    it is level.
    """

    normal: NotRequired[Point3 | None]


SureLegDocument = TypedDict(
    "SureLegDocument",
    {
        "from": Name,
        "to": Name,
        "length_m": NotRequired[NotNegative | None],
        "time_s": PositiveDocument,
        "energy_j": AmountDocument,
        "p_lose": NotRequired[dict[str, Share] | None],
        "route": NotRequired[tuple[Coordinates, ...] | None],
        "refs": NotRequired[object],
    },
)
document(SureLegDocument)


@document
class LegDocument(SureLegDocument):
    """A drive that may fail."""

    p_fail: NotRequired[Share | None]


@document
class TrackStartDocument(TypedDict):
    """What starting to track a target takes."""

    time_s: NotNegative
    energy_j: NotNegative


@document
class BudgetDocument(TypedDict):
    """What may be used in all."""

    time_s: NotNegative
    energy_j: NotNegative
    energy_floor_j: NotRequired[NotNegative | None]
    data_mbit: NotRequired[NotNegative | None]


class _Day(TypedDict):
    name: Name
    units: NotRequired[object]
    hotel_w: NotNegative
    overrun_penalty: NotRequired[NotNegative | None]
    track_start: TrackStartDocument
    track_overhead_s_per_leg: NotNegative


class _Problem(_Day):
    budget: BudgetDocument
    max_overrun_probability: NotRequired[Share | None]
    start: NotRequired[PoseDocument | None]
    refs: NotRequired[dict[str, str] | None]
    precedence: NotRequired[tuple[Annotated[tuple[str, ...], MinLen(2), MaxLen(2)], ...] | None]


@document
class SolKindDocument(TypedDict):
    """A kind of sol: its probability, and what it multiplies times and energies of drives, and all energies,
    with.
    """

    name: Name
    p: Share
    drive_time_factor: NotRequired[Factor | None]
    drive_energy_factor: NotRequired[Factor | None]
    energy_factor: NotRequired[Factor | None]


@document
class ProblemDocument(_Problem):
    """A planning problem."""

    targets: Annotated[tuple[TargetDocument, ...], MaxLen(MAX_TARGETS)]
    legs: tuple[LegDocument, ...]
    sol_kinds: NotRequired[Annotated[tuple[SolKindDocument, ...], MaxLen(MAX_SOL_KINDS)] | None]
    intraday_correlation: NotRequired[dict[Name, Share] | None]
    """Of the successes of an instrument's observations on one day, by the instrument; independent without."""


@document
class SureProblemDocument(_Problem):
    """A planning problem of `problem/1`, in which no drive fails, all sols are of one kind, surfaces are
    level and observations succeed independently.
    """

    targets: Annotated[tuple[SureTargetDocument, ...], MaxLen(MAX_TARGETS)]
    legs: tuple[SureLegDocument, ...]


@document
class ContingencyTarget(_Observed):
    """A target of `contingency/1` with its one observation."""

    id: Name
    p_success: Chance
    target_m: NotRequired[Coordinates | None]
    observation_point_m: NotRequired[Coordinates | None]
    point_m: NotRequired[object]


@document
class ContingencyDocument(_Day):
    """A planning problem of `contingency/1`."""

    budget: TrackStartDocument
    family: NotRequired[object]
    seed: NotRequired[object]
    cone_half_angle_deg: NotRequired[object]
    legs: tuple[SureLegDocument, ...]
    targets: Annotated[tuple[ContingencyTarget, ...], MaxLen(MAX_TARGETS)]


CONTINGENCY = Codec(ContingencyDocument, "contingency/1", "problem", error=ProblemError)


def _problem_of(members: dict[str, Any]) -> dict[str, Any]:
    """Return the members of `problem/1` that say what those of `contingency/1` do."""
    found: Any = CONTINGENCY.from_document({"format": CONTINGENCY.format, **members})
    for leg in found["legs"]:
        if "p_lose" not in leg:
            raise ProblemError(f"problem legs[{leg['from']} -> {leg['to']}].p_lose is missing")
    for target in found["targets"]:
        one = {k: target.pop(k) for k in (*_Observed.__annotations__, "p_success") if k in target}
        target["observations"] = [one | {"id": target["id"]}]
        target.pop("point_m", None)
        target["point_m"] = target.pop("target_m", None)
        if pose := target.pop("observation_point_m", None):
            target["observation_point"] = {"east_m": pose[0], "north_m": pose[1]}
    return {k: v for k, v in found.items() if k in ProblemDocument.__annotations__}


def _of_one_kind(members: dict[str, Any]) -> dict[str, Any]:
    """Return the members of a `problem/1`, in which no drive fails, all sols are of one kind and surfaces are
    level, as those of `problem/2`.
    """
    if members.get("intraday_correlation") is not None:
        said = f"problem intraday_correlation is {shown(members['intraday_correlation'])}"
        raise ProblemError(f"{said}; successes that go together need the format problem/2")
    if members.get("sol_kinds") is not None:
        given = len(members["sol_kinds"]) if isinstance(members["sol_kinds"], list | tuple) else 1
        raise ProblemError(f"problem sol_kinds states {given}; kinds of sols need the format problem/2")
    legs = members.get("legs")
    for leg in legs if isinstance(legs, list) else ():
        if isinstance(leg, Mapping) and leg.get("p_fail") is not None:
            ends = f"{leg.get('from')} -> {leg.get('to')}"
            raise ProblemError(
                f"problem legs[{ends}].p_fail is {shown(leg['p_fail'])}; drives that fail need the format "
                f"problem/2"
            )
    targets = members.get("targets")
    for target in targets if isinstance(targets, list | tuple) else ():
        if isinstance(target, Mapping) and target.get("normal") is not None:
            said = f"problem targets[{target.get('id')}].normal is {shown(target['normal'])}"
            raise ProblemError(f"{said}; normals need the format problem/2")
    return members


def drives_fail(problem: ProblemDocument) -> bool:
    """Return whether some drive of a problem has a chance to fail."""
    return any(leg.get("p_fail") for leg in problem["legs"])


def says_all(problem: ProblemDocument) -> bool:
    """Return whether `contingency/1` can say all that a problem does."""
    if (
        problem.get("sol_kinds")
        or problem.get("intraday_correlation")
        or not problem.keys() <= ContingencyDocument.__annotations__.keys()
        or drives_fail(problem)
    ):
        return False
    if not problem["budget"].keys() <= TrackStartDocument.__annotations__.keys():
        return False
    return all(_one_observation(target) for target in problem["targets"])


def _one_observation(target: TargetDocument) -> bool:
    held = {"id", "observations", "point_m", "observation_point"}
    if len(target["observations"]) != 1 or not target.keys() <= held:
        return False
    (only,) = target["observations"]
    stand = target.get("observation_point")
    faces = stand is not None and bool(stand.get("heading_rad"))
    return (
        only["id"] == target["id"]
        and only.keys() <= {*_Observed.__annotations__, "id", "p_success"}
        and not faces
    )


def contingency_document(problem: ProblemDocument) -> ContingencyDocument:
    """Return `contingency/1` for a problem that was read from it."""
    targets = []
    for target in problem["targets"]:
        row: Any = {
            k: v for k, v in target["observations"][0].items() if k in ContingencyTarget.__annotations__
        }
        row["id"] = target["id"]
        if point := target.get("point_m"):
            row["target_m"] = point
        if pose := target.get("observation_point"):
            row["observation_point_m"] = (pose["east_m"], pose["north_m"])
        targets.append(row)
    members: Any = {k: v for k, v in problem.items() if k in ContingencyDocument.__annotations__}
    return cast("ContingencyDocument", {**members, "targets": tuple(targets)})


PROBLEMS = Codec(
    ProblemDocument,
    "problem/2",
    "problem",
    upgrades={CONTINGENCY.format: ("problem/1", _problem_of), "problem/1": ("problem/2", _of_one_kind)},
    error=ProblemError,
)

SURE_DRIVES = Codec(SureProblemDocument, "problem/1", "problem", error=ProblemError)
"""What a problem in which no drive fails, all sols are of one kind, surfaces are level and observations
succeed independently is written with: older programs read it, and its digest stays.
"""


def problem_document(problem: ProblemDocument) -> dict[str, Any]:
    """Return a problem as a document of the oldest form, `problem/1` or later, that can say all of it."""
    slanting = any(target.get("normal") for target in problem["targets"])
    more = problem.get("sol_kinds") or problem.get("intraday_correlation")
    if drives_fail(problem) or more or slanting:
        return PROBLEMS.document(problem)
    sure = tuple({k: v for k, v in leg.items() if k != "p_fail"} for leg in problem["legs"])
    said = {k: v for k, v in problem.items() if k not in {"sol_kinds", "intraday_correlation"}}
    return SURE_DRIVES.document(cast("SureProblemDocument", {**said, "legs": sure}))
