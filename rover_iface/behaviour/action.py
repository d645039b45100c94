"""Actions: what a command sets going, as a generator that can wait, be interrupted and run beside others."""

from __future__ import annotations

from collections.abc import Generator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, TypeVar

from executive.ports import Command, Value

Route = Sequence[tuple[float, float]]
T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Step:
    """A part of an action that takes time: it goes on after so many whole milliseconds.

    Only hardware makes steps. A simulated one foretells what is used (joules besides the hotel load) and the
    way that is driven meanwhile; a real one says when it wants to be asked again.
    """

    duration_ms: int
    energy_j: float = 0.0
    route: Route = ()


@dataclass(frozen=True, slots=True)
class Outcome:
    """How an action ended."""

    success: bool
    reason: str = ""
    values: Mapping[str, Value] = field(default_factory=dict)


Doing: TypeAlias = Generator[Step, None, T]
"""Something that takes time and then gives a value: wait for it with `yield from`."""

Action: TypeAlias = Generator[Step, None, Outcome]


def number(command: Command, name: str, default: float) -> float:
    """Return a numeric parameter of a command, or the default."""
    value = command.parameters.get(name, default)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else default
