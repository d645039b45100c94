"""Rehearse a run with the link that there will be: late commands, and what the ground knows when."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from executive.ports import Operation, Operator
from ground.errors import InvalidInputError
from ground.uplink.flight import Flight
from ground.uplink.link import KnownCommand, Link, ground_view

GROUND_VIEW = "ground.json"
"""In the folder of a rehearsal with a link: when the ground knows what."""
SENDABLE = (Operation.ABORT, Operation.PAUSE, Operation.RESUME)


@dataclass(frozen=True, slots=True)
class Sent:
    """A command of the operator and when the ground wants to send it, seconds after the plan's start."""

    operation: Operation
    sent_s: float

    @classmethod
    def parse(cls, text: str) -> Sent:
        """Return the command of a text such as `abort@3600`.

        Raises
        ------
        InvalidInputError
            If the operation is not known or the time is not a number from 0 on.
        """
        word, _, time = text.partition("@")
        try:
            operation, sent_s = Operation(word), float(time)
        except ValueError:
            operation, sent_s = Operation.REPLACE, -1.0
        if operation not in SENDABLE or not 0.0 <= sent_s < math.inf:
            known = ", ".join(f"{o.value}@SECONDS" for o in SENDABLE)
            raise InvalidInputError(f"{text!r} is not a command; known are {known}")
        return cls(operation, sent_s)


Reach = list[tuple[Sent, Operator | None]]
"""What was sent, and what the rover hears of it and when; None of what comes after the last pass."""


def heard(link: Link | None, commands: Sequence[Sent]) -> Reach:
    """Return the commands with what the rover hears of them; without a link it hears all at once."""
    times = [(sent, (link or Link()).command_arrives_s(sent.sent_s)) for sent in commands]
    return [
        (sent, None if t_s is None else Operator(round(1000 * t_s), sent.operation)) for sent, t_s in times
    ]


def write_ground_view(
    out: Path, link: Link, flight: Flight, reach: Sequence[tuple[Sent, Operator | None]]
) -> None:
    """Write when the ground knows what of a run into its folder."""
    run = flight.outcome
    view = ground_view(
        link,
        [(record.t_ms / 1000, record.event) for record in run.trace],
        [(p.t_ms / 1000, p.path, (out / p.path).stat().st_size) for p in run.products],
        end_s=run.end_s,
        commands=[
            KnownCommand(sent.operation.value, sent.sent_s, None if event is None else event.t_ms / 1000)
            for sent, event in reach
        ],
    )
    (out / GROUND_VIEW).write_text(view.text(), encoding="utf-8")
