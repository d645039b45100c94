"""The documents `plan-tree/1` and `plan-tree/2` as types, read and written by one codec.

Members that are not known are read over: tools keep notes of their own in a plan.
"""

from __future__ import annotations

from typing import Annotated, Literal, NotRequired, TypeAlias

from annotated_types import MaxLen, MinLen
from typing_extensions import TypedDict  # pydantic asks for it before Python 3.12

from mission.codec import Codec
from mission.values import ToldBy
from planner.errors import PlanTreeError

Failing = Literal["stop", "skip"]


class ThresholdDocument(TypedDict):
    """Time or energy used, compared with a number: at least `ge` or less than `lt`."""

    var: Literal["time_s", "energy_j"]
    ge: NotRequired[float]
    lt: NotRequired[float]


TrackedDocument = TypedDict("TrackedDocument", {"var": Literal["tracked"], "target": str, "is": bool})
DoneDocument = TypedDict(
    "DoneDocument",
    {
        "var": Literal["done"],
        "target": NotRequired[str | None],
        "observation": NotRequired[str | None],
        "is": bool,
    },
)
ConditionDocument: TypeAlias = Annotated[ThresholdDocument | TrackedDocument | DoneDocument, ToldBy("var")]


class QuantilesDocument(TypedDict):
    """Quantiles of time and energy used when a step begins, over the futures that reach it."""

    p: tuple[float, ...]
    time_s: tuple[float, ...]
    energy_j: tuple[float, ...]


class NotesDocument(TypedDict):
    """What is expected at a step: the chance that it is reached, and what is used by then."""

    p_reached: NotRequired[float]
    quantiles: NotRequired[QuantilesDocument]


class TrackDocument(NotesDocument):
    """Begin to track a target, or stop."""

    op: Literal["track_start", "track_stop"]
    target: str
    on_fail: NotRequired[Failing]


class NavigateDocument(NotesDocument):
    """Drive to a target."""

    op: Literal["navigate"]
    to: str
    require_tracked: NotRequired[bool]
    on_fail: NotRequired[Failing]


class ObserveDocument(NotesDocument):
    """Make an observation, or drive and make it; one that is not named is the only one of the target."""

    op: Literal["observe", "visit"]
    target: NotRequired[str | None]
    observation: NotRequired[str | None]
    wait_until_s: NotRequired[float]
    on_fail: NotRequired[Failing]


class StopDocument(NotesDocument):
    """End the plan here."""

    op: Literal["stop"]


class BranchDocument(NotesDocument):
    """A choice: the first option whose conditions hold takes the place of the rest of the plan."""

    op: Literal["branch"]
    options: tuple[OptionDocument, ...]


StepDocument: TypeAlias = Annotated[
    TrackDocument | NavigateDocument | ObserveDocument | StopDocument | BranchDocument, ToldBy("op")
]


class OptionDocument(TypedDict):
    """An alternative, with the chance that it is taken, what it wins, and utility to come over time."""

    id: NotRequired[str]
    when: tuple[ConditionDocument, ...]
    p_taken: NotRequired[float]
    gain: NotRequired[float]
    utility_table: NotRequired[tuple[Annotated[tuple[float, ...], MinLen(2), MaxLen(2)], ...]]
    plan: tuple[StepDocument, ...]


class TreeDocument(TypedDict):
    """A contingent plan for the problem named `instance`."""

    instance: NotRequired[str]
    method: NotRequired[str]
    problem_sha256: NotRequired[str]
    expected_utility: NotRequired[float]
    plan: tuple[StepDocument, ...]


TREES = Codec(
    TreeDocument,
    "plan-tree/2",
    "plan tree",
    upgrades={"plan-tree/1": ("plan-tree/2", lambda members: members)},
    error=PlanTreeError,
)
TREES_1 = Codec(TreeDocument, "plan-tree/1", "plan tree", error=PlanTreeError)
