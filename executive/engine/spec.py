"""A plan made ready to run: windows in milliseconds, conditions compiled, fields with their defaults.

Nothing here changes during a run; what changes lives in `instance.py`. `compile_plan.py` makes these values
from the nodes of the language.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from executive.crl.values import IfNone, OnResume, Utility, utility_at
from executive.engine.conditions import Guard
from executive.ports import Value

INFINITY = 1 << 60
"""An unbounded time, milliseconds; far beyond any plan clock."""

START, END = 0, 1


class Kind(IntEnum):
    TASK = 0
    BLOCK = 1
    CONCURRENT = 2
    BRANCH = 3


TASK, BLOCK, CONCURRENT, BRANCH = Kind

PLAN_CLOCK = ""
"""Reference of a window on the plan clock."""

RELATIVE = ":relative"
"""Reference of a window relative to the activation (starts) or to the own start (ends)."""


@dataclass(frozen=True, slots=True)
class Window:
    """`lo <= point - reference <= hi` in milliseconds; `ref` is a node id, PLAN_CLOCK or RELATIVE."""

    ref: str
    point: int
    lo: int
    hi: int


@dataclass(slots=True, eq=False)
class OptionSpec:
    id: str
    node: NodeSpec
    utility: Utility
    eligible: Guard | None
    requires: tuple[tuple[str, float], ...]


@dataclass(slots=True, eq=False)
class NodeSpec:
    """One node of a plan; fields of other kinds keep their defaults."""

    kind: Kind
    id: str
    wait_for: Guard | None = None
    start: Guard | None = None
    maintain: Guard | None = None
    end: Guard | None = None
    start_windows: tuple[Window, ...] = ()
    end_windows: tuple[Window, ...] = ()
    continue_on_failure: bool = False
    uses: tuple[tuple[str, float], ...] = ()
    requires: tuple[tuple[str, float], ...] = ()
    priority: float = 50.0
    reward: float = 0.0
    action: str = ""
    parameters: Mapping[str, Value] = field(default_factory=dict)
    metadata: Mapping[str, Value] = field(default_factory=dict)
    retries: int = 0
    retry_delay_ms: int = 0
    interruptible: bool = True
    on_resume: OnResume = OnResume.REATTACH
    children: tuple[NodeSpec, ...] = ()
    """The nodes one level down, in text order; of a branch those of its options."""
    options: tuple[OptionSpec, ...] = ()
    if_none: IfNone = IfNone.FAIL
    next_on_failure: bool = False
    constant_utilities: bool = True
    """Whether no option's utility changes with time."""

    def ranked_options(self) -> list[tuple[int, OptionSpec]]:
        """Return the options with their numbers; the most useful first if no utility changes with time."""
        numbered = list(enumerate(self.options))
        if self.constant_utilities:
            numbered.sort(key=lambda entry: (-utility_at(entry[1].utility, 0), entry[0]))
        return numbered

    def walk(self) -> Iterator[NodeSpec]:
        """Yield the node and its descendants in text order."""
        stack = [self]
        while stack:
            node = stack.pop()
            yield node
            stack.extend(reversed(node.children))


@dataclass(slots=True, eq=False)
class ContingencySpec:
    id: str
    node: NodeSpec
    trigger: Guard
    utility: Utility
    interrupt: bool
    scope: str
    max_insertions: int
    continue_on_failure: bool


@dataclass(slots=True, eq=False)
class AlternateSpec:
    id: str
    node: NodeSpec
    eligible: Guard | None
    utility: Utility
    requires: tuple[tuple[str, float], ...]


@dataclass(frozen=True, slots=True)
class ResourceSpec:
    """A unit resource is a capacity of 1; a consumable has the database key of its level and a floor."""

    name: str
    capacity: float | None
    key: str | None = None
    floor: float = 0.0


@dataclass(slots=True, eq=False)
class PlanSpec:
    id: str
    root: NodeSpec
    identity: Callable[[str], str]
    """Canonical text of the task of an id; two tasks are identical iff it is equal (CRL.md 2)."""
    epoch: str | None = None
    """UTC instant of plan time 0 (ISO 8601)."""
    resources: dict[str, ResourceSpec] = field(default_factory=dict)
    contingencies: tuple[ContingencySpec, ...] = ()
    alternates: tuple[AlternateSpec, ...] = ()
    overrun_penalty: float = 0.0
    budgets: tuple[tuple[str, float], ...] = ()
    digest: str = ""
    text: str = ""
    """Canonical text, which a journal holds so that it can be replayed by itself."""
    windowed: tuple[NodeSpec, ...] = ()
    """All nodes that have windows, in any tree."""

    def __post_init__(self) -> None:
        nodes = (node for tree in self.trees() for node in tree.walk())
        self.windowed = tuple(node for node in nodes if node.start_windows or node.end_windows)

    def trees(self) -> list[NodeSpec]:
        """Return the roots of all trees of the plan: the main tree, contingencies, alternates."""
        return [self.root, *(c.node for c in self.contingencies), *(a.node for a in self.alternates)]

    def node_ids(self) -> list[str]:
        """Return the ids of all nodes in text order, the main tree first."""
        return [node.id for tree in self.trees() for node in tree.walk()]
