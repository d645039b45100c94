"""Work, counted in steps that do not depend on the machine, and reckoned in seconds of one processor.

A limit in seconds by a clock makes a plan depend on what else the machine does. So the heavy steps of
planning are counted where they are done (`spend`), each kind with what one of them takes on a processor of
2.1 GHz, and limits look at the sum alone: the same order does the same steps and gives the same plan at any
load. `studies.planner_work` measures how far the sum is from the processor seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import StrEnum

from planner.errors import PlannerError


class Step(StrEnum):
    """Kinds of steps; one of each takes `SECONDS` of a processor."""

    NODE = "node"
    """A multiplication and addition of chains and of policies along an order, in double precision."""
    PRODUCT = "product"
    """The same in the kernel of an action on a grid."""
    CELL = "cell"
    """The same in single precision: tables of the optimal policy and of the bound."""
    PASS = "pass"
    """One node of a grid read and written once, node by node."""
    ELEMENT = "element"
    """One node of a fine or sampled function worked out."""
    ACT = "act"
    """One action on a grid, beside its products and passes."""
    WAY = "way"
    """One way in which a drive of a plan may end, in one state of the rover."""
    ROW = "row"
    """One row of a plan compiled, or valued in one state."""
    CALL = "call"
    """Some 100 small operations of the interpreter: of linear programs, walks and futures."""
    DRIVE = "drive"
    """The drives of a table to one place, from wherever they begin."""
    LOST = "lost"
    """One way in which drives of a table may end: the tracks that they lose."""
    SET = "set"
    """One live set found."""
    COUNTED = "counted"
    """One live set counted by compiled code."""
    LABEL = "label"
    """One label of a route on mean values."""
    ACTION = "action"
    """One action of one future carried out."""
    WIDE = "wide"
    """One way on from a label of the exact engine looked at."""
    RELAXED = "relaxed"
    """One move from one cell of that engine's table."""
    SURVEY = "survey"
    """One step of the survey engine for each node that it looks at."""
    PRICED = "priced"
    """One move of one state of a Lagrangean relaxation to one node."""
    PIVOT = "pivot"
    """One row in one iteration of a linear program."""
    HANDED = "handed"
    """One number handed to or taken from the linear solver."""
    ARC = "arc"
    """One arc looked at in the search for cuts of a fractional tour."""


SECONDS: dict[Step, float] = {
    Step.NODE: 1.6e-10,
    Step.PRODUCT: 6.0e-11,
    Step.CELL: 2.6e-11,
    Step.PASS: 7.0e-10,
    Step.ELEMENT: 6.0e-9,
    Step.ACT: 7.0e-6,
    Step.WAY: 2.9e-6,
    Step.ROW: 3.0e-6,
    Step.CALL: 5.5e-5,
    Step.DRIVE: 3.0e-5,
    Step.LOST: 1.9e-6,
    Step.SET: 3.0e-5,
    Step.COUNTED: 5.0e-7,
    Step.LABEL: 1.0e-5,
    Step.ACTION: 6.0e-8,
    Step.WIDE: 1.5e-7,
    Step.RELAXED: 1.4e-8,
    Step.SURVEY: 2.4e-8,
    Step.PRICED: 6.5e-10,
    Step.PIVOT: 1.0e-7,
    Step.HANDED: 1.5e-6,
    Step.ARC: 1.8e-8,
}
"""Fitted by hand to processor seconds of 20 days of 4 to 9 targets (seeds 5 and 11) and of single kernels;
those of grids and plans to seconds by function on days of 8 targets with and without drives that fail (7)."""


POLL_S = 0.02
"""Reckoned seconds after which whoever may stop the work is asked again. By hand."""


class StoppedError(PlannerError):
    """Somebody wants the work stopped: raised wherever it stands, and caught by `solve`."""


@dataclass(eq=False)
class Tally:
    """What was done since it was begun: seconds as reckoned, and steps by kind."""

    seconds: float = 0.0
    steps: dict[Step, float] = field(default_factory=dict)
    stop: Callable[[], bool] | None = None
    polled: float = 0.0

    def add(self, step: Step, count: float) -> None:
        """Count steps of a kind.

        Raises
        ------
        StoppedError
            If the work is to stop; once, so that what was found can still be put together.
        """
        self.seconds += SECONDS[step] * count
        self.steps[step] = self.steps.get(step, 0.0) + count
        if self.stop is not None and self.seconds >= self.polled:
            self.polled = self.seconds + POLL_S
            if self.stop():
                self.stop = None
                raise StoppedError("stopped")


_RUNNING: ContextVar[Tally | None] = ContextVar("tally", default=None)


def spend(step: Step, count: float = 1.0) -> None:
    """Count steps in the tally that is kept here, if one is; raises `StoppedError` as `Tally.add` does."""
    tally = _RUNNING.get()
    if tally is not None:
        tally.add(step, count)


def now_s() -> float:
    """Return the seconds of the tally that is kept here; 0 where none is."""
    tally = _RUNNING.get()
    return 0.0 if tally is None else tally.seconds


def affordable(step: Step, seconds: float) -> int:
    """Return how many steps of a kind so many reckoned seconds pay for."""
    return int(min(seconds / SECONDS[step], 1e15)) if seconds > 0.0 else 0


@contextmanager
def tallied() -> Iterator[Tally]:
    """Keep a tally of what is done inside; where one is kept already, that one goes on."""
    running = _RUNNING.get()
    if running is not None:
        yield running
        return
    token = _RUNNING.set(Tally())
    try:
        found = _RUNNING.get()
        assert found is not None
        yield found
    finally:
        _RUNNING.reset(token)


@contextmanager
def uncounted() -> Iterator[None]:
    """Leave what is done inside out of the tally that is kept here: it is done once a process, whoever asks
    first.
    """
    token = _RUNNING.set(None)
    try:
        yield
    finally:
        _RUNNING.reset(token)
