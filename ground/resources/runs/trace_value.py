"""What a run left: trace, telemetry, the executive at one moment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class TraceEvent:
    """One record of the executive's trace (CRL reference, section 10)."""

    t_s: float
    event: str
    arguments: list[str]


@dataclass(frozen=True, slots=True)
class Trace:
    run_id: str
    outcome: str
    end_s: float
    events: list[TraceEvent]


@dataclass(frozen=True, slots=True)
class NodeState:
    """A node of the running plan; times on the plan clock, null is unbounded or not yet.

    `window_s` bounds the start while the node waits and the end after it; `chosen` is the option taken.
    """

    id: str
    kind: str
    parent: str | None
    state: str
    outcome: str | None
    reason: str
    start_s: float | None
    end_s: float | None
    window_s: list[float | None]
    attempts: int
    chosen: str | None
    action: str | None
    held: bool


@dataclass(frozen=True, slots=True)
class CommandState:
    """A command the rover has not answered yet."""

    task: str
    attempt: int
    abort_asked: bool


@dataclass(frozen=True, slots=True)
class ContingencyState:
    """A floating contingency: whether it may fire, has fired, and is being carried out (`phase`)."""

    id: str
    armed: bool
    triggered: bool
    insertions: int
    phase: str


@dataclass(frozen=True, slots=True)
class RunSnapshot:
    """The executive after the macro step of record `seq` of the journal, which goes up to `last_seq`.

    `trace_count` records of the trace were written by then. `watched` gives for each state key the nodes
    whose conditions wait for it, `pending_events` what was announced and has not come, `resources` the level
    or capacity of each resource, `database` the state keys as the executive knew them.
    """

    run_id: str
    seq: int
    last_seq: int
    complete: bool
    t_s: float
    trace_count: int
    paused: bool
    over: bool
    outcome: str | None
    next_wakeup_s: float | None
    reward: float
    nodes: list[NodeState]
    commands: list[CommandState]
    contingencies: list[ContingencyState]
    watched: dict[str, list[str]]
    pending_events: list[dict[str, Any]]
    resources: dict[str, dict[str, float | str | bool | None]]
    database: dict[str, float | str | bool | None]


@dataclass(frozen=True, slots=True)
class Samples:
    """Samples of a run as columns of equal length, as they are stored; a value not known yet is null."""

    t_s: list[float]
    east_m: list[float | None]
    north_m: list[float | None]
    heading_rad: list[float | None]
    battery_j: list[float | None]
    energy_used_j: list[float | None]
    task: list[str | None]
    tracker_confidence: dict[str, list[float | None]]
    tracker_state: dict[str, list[str | None]]


@dataclass(frozen=True, slots=True)
class Telemetry(Samples):
    """Samples of a run, and whether these are all."""

    run_id: str
    complete: bool
