"""Flies one seed of a case: to a row, or again into a whole `run/1` folder."""

from __future__ import annotations

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from executive.ports import Acknowledgement, Command, CommandId, CommandStatus, Event, Result, Rover, Update
from executive.runtime.loading import load_plan
from executive.runtime.run import run_plan
from executive.runtime.session import RunOutcome
from ground.campaigns.case import Case
from ground.campaigns.row import UNFINISHED, Row, letters_of
from ground.errors import StateError

if TYPE_CHECKING:
    from rover_iface.simulator.model import Future

TOLD = frozenset({"FAILED", "ABORTED"})
LOST = "trackerstate "


@lru_cache(maxsize=8)
def pilot_of(case: Case) -> Pilot:
    """Return the pilot of a case; made once in a process."""
    return Pilot(case)


class Pilot:
    """Holds what all runs of a case share: the compiled plan and the world that was read.

    Raises
    ------
    RoverError
        If the world cannot be read, or there is no such rover.
    CrlError
        If the plan is rejected.
    """

    def __init__(self, case: Case) -> None:
        from rover_iface.registry import find_rover
        from rover_iface.simulator.world import load_world

        self.case = case
        self._make = find_rover(case.rover)
        self._world = load_world(case.world)
        self._plan = load_plan(case.crl_text)
        self.node_ids = tuple(sorted(self._plan.node_ids()))

    def row(self, seed: int, future: Future | None = None) -> Row:
        """Fly a seed and return its row; with a `future` (abstract rover only) that is what happens."""
        drawn = {} if future is None else {"draws": future}
        watch = Watch(self._make(self._world, seed=seed, **drawn))
        return self._row(seed, run_plan(self._plan, watch, run_id=run_name(seed)), watch)

    def replay(self, seed: int, folder: Path) -> Row:
        """Fly a seed into a `run/1` folder with journal and products, and return its row."""
        from ground.uplink.flight import fly

        watch = Watch(self._make(self._world, seed=seed, out=folder))
        about = {"rover": self.case.rover, "seed": seed, "case": self.case.digest}
        flight = fly(self.case.crl_text, watch, folder, run_id=run_name(seed), about=about, sync=False)
        return self._row(seed, flight.outcome, watch)

    def _row(self, seed: int, outcome: RunOutcome, watch: Watch) -> Row:
        reasons: dict[str, str] = {}
        digest = hashlib.sha256()
        options = []
        for record in outcome.trace:
            arguments = record.arguments
            digest.update(f"[{record.t_ms / 1000!r}, {_tail(record.event, arguments)}\n".encode())
            if record.event == "choose":
                options.append(arguments[1])
            elif record.event == "end" and len(arguments) > 2 and arguments[1] in TOLD:
                said = watch.said.get(arguments[0]) if arguments[2] == "action-failed" else None
                reasons[arguments[0]] = f"{arguments[2]}: {said}" if said else arguments[2]
        last_ms = outcome.trace[-1].t_ms if outcome.trace else 0
        return Row(
            seed,
            outcome.utility,
            outcome.outcome or UNFINISHED,
            last_ms if outcome.end_ms is None else outcome.end_ms,
            round(watch.energy_used_j, 3),
            outcome.exceeded,
            tuple(options),
            letters_of(outcome.outcomes, self.node_ids),
            reasons,
            tuple(watch.lost),
            digest.hexdigest()[:16],
        )


def run_name(seed: int) -> str:
    """Return the id of the run with a seed."""
    return f"seed-{seed}"


@lru_cache(maxsize=4096)
def _tail(event: str, arguments: tuple[str, ...]) -> str:
    """Return what follows the time in a line of `trace.jsonl`."""
    return json.dumps([event, *arguments])[1:]


class Watch:
    """A rover that remembers the little that a row says of it.

    Attributes
    ----------
    energy_used_j
        As last reported.
    lost
        Targets whose track was lost, in order.
    said
        Why the last command of a task failed, in the rover's words.
    """

    def __init__(self, rover: Rover) -> None:
        self._rover = rover
        self.energy_used_j = 0.0
        self.lost: dict[str, None] = {}
        self.said: dict[str, str] = {}

    def send(self, command: Command) -> None:
        self._rover.send(command)

    def abort(self, command: CommandId) -> None:
        self._rover.abort(command)

    def status(self, command: CommandId) -> CommandStatus:
        return self._rover.status(command)

    def next_event(self, until_ms: int | None) -> Event | None:
        event = self._rover.next_event(until_ms)
        if event is None:
            return None
        match event:
            case Result(updates=values):
                if not event.success:
                    self.said[event.command.task] = event.reason
            case Acknowledgement(updates=values) | Update(values=values):
                pass
            case _:
                return event
        for key, value in values.items():
            if key == "energy-used":
                self.energy_used_j = float(value)
            elif value == "lost" and key.startswith(LOST):
                self.lost.setdefault(key[len(LOST) :])
        return event


def replay_row(case: Case, counted: Row, folder: Path) -> Row:
    """Fly a counted run again into a folder; return its row, which is equal to the counted one.

    Raises
    ------
    StateError
        If it is another run: the program is not the one that counted it. The folder stays, to be compared.
    """
    again = pilot_of(case).replay(counted.seed, folder)
    if again != counted:
        raise StateError(
            f"seed {counted.seed} does not replay: trace {again.trace}, utility {again.utility:g}; counted "
            f"was {counted.trace}, {counted.utility:g}"
        )
    return again
