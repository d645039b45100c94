"""Random acts of people, taken back in random order: the mission is afterwards what it was before.

    .venv/bin/python -m studies.undo_in_any_order --acts 1000

An undo that is refused names the act that rests on it, and is tried again when that was taken back. Whether
the named act truly rests on it is judged here from the events alone, by a rule written apart from the
program's.
"""

from __future__ import annotations

import argparse
import hashlib
import random
import secrets
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson
from sqlalchemy import select

from ground.errors import GroundError, StateError
from ground.gdr.history import EventRow, dump_row, verify_chains
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import Actor, Role
from ground.records.change_resource import change_resource
from ground.records.delete_resource import delete_resource
from ground.resources.frames.bodies import FrameCreate
from ground.resources.frames.create_frame import create_frame
from ground.resources.history.undo import undo
from ground.resources.keep_outs.bodies import KeepOutChange, KeepOutCreate
from ground.resources.keep_outs.create_keep_out import create_keep_out
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.kinds import KINDS
from ground.resources.mission_setup.create_mission import GeneratedTerrain, create_mission
from ground.resources.missions.bodies import MissionChange
from ground.resources.observation_requests.bodies import ObservationRequestChange, ObservationRequestCreate
from ground.resources.observation_requests.create_request import create_request
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.people.accounts import ensure_profiles
from ground.resources.sols.bodies import SolChange, SolCreate
from ground.resources.sols.create_sol import create_sol
from ground.resources.sols.row import SolRow
from ground.resources.solutions.choose_solution import GivenSolution, add_solution, choose_solution
from ground.resources.targets.bodies import TargetChange, TargetCreate
from ground.resources.targets.create_target import create_target
from ground.resources.targets.row import TargetRow
from ground.settings import load_settings

PEOPLE = (Actor("Planner", Role.PLANNER), Actor("Flight Director", Role.FLIGHT_DIRECTOR))
INSTRUMENTS = ("science_camera", "microscopic_imager")
NAMES = tuple(f"Rock{n}" for n in range(12))
HALF_M = 8.0


def digest(repo: Repository, mission_id: str) -> str:
    """Return a SHA-256 over all that people can undo in a mission, without counts of changes."""
    found = []
    with repo.database.read() as session:
        for kind in KINDS.values():
            if kind.undoable:
                rows: Any = kind.row
                column = rows.id if kind.name == "mission" else rows.mission_id
                for row in session.scalars(select(rows).where(column == mission_id).order_by(rows.id)):
                    document = dump_row(row)
                    found.append({k: v for k, v in document.items() if k not in {"revision", "modified_utc"}})
    return hashlib.sha256(orjson.dumps(found, option=orjson.OPT_SORT_KEYS)).hexdigest()


@dataclass
class Hand:
    """Somebody who does one random thing after another."""

    repo: Repository
    mission_id: str
    rng: random.Random
    anchor: str = ""
    done: Counter[str] = field(default_factory=Counter)

    def act(self) -> None:
        """Do one thing; one that the rules refuse is not an act."""
        deeds: list[Callable[[Actor], object]] = [
            *[self.target] * 3,
            *[self.move] * 3,
            *[self.name] * 3,
            self.drop_target,
            *[self.request] * 3,
            *[self.change] * 4,
            *[self.order] * 3,
            self.drop_request,
            self.keep_out,
            self.redraw,
            self.drop_keep_out,
            self.sol,
            *[self.budget] * 2,
            self.drop_sol,
            self.rule,
            self.frame,
            self.tie,
            *[self.choose] * 2,
        ]
        deed = self.rng.choice(deeds)
        try:
            deed(self.rng.choice(PEOPLE))
            self.done[deed.__name__] += 1
        except GroundError:
            self.done["refused"] += 1

    def one(self, row: Any) -> str:
        with self.repo.database.read() as session:
            found = session.scalars(select(row.id).where(row.mission_id == self.mission_id)).all()
        if not found:
            raise StateError("there is none")
        return self.rng.choice(sorted(found))

    def place(self) -> float:
        return round(self.rng.uniform(-HALF_M, HALF_M), 2)

    def set(self, who: Actor, kind: str, identifier: str, given: Any) -> None:
        change_resource(self.repo, who, KINDS[kind], identifier, given, None)

    def target(self, who: Actor) -> None:
        given = TargetCreate(east_m=self.place(), north_m=self.place(), name=self.rng.choice(NAMES))
        create_target(self.repo, who, self.mission_id, given)

    def move(self, who: Actor) -> None:
        given = TargetChange(east_m=self.place(), north_m=self.place())
        self.set(who, "target", self.one(TargetRow), given)

    def name(self, who: Actor) -> None:
        given: dict[str, Any] = self.rng.choice(
            [{"name": self.rng.choice(NAMES)}, {"notes": str(self.rng.randrange(100))}]
        )
        self.set(who, "target", self.one(TargetRow), TargetChange(**given))

    def drop_target(self, who: Actor) -> None:
        delete_resource(self.repo, who, KINDS["target"], self.one(TargetRow), None)

    def request(self, who: Actor) -> None:
        given = ObservationRequestCreate(
            target_id=self.one(TargetRow),
            instrument=self.rng.choice(INSTRUMENTS),
            value=float(self.rng.randrange(1, 20)),
        )
        create_request(self.repo, who, self.mission_id, given)

    def change(self, who: Actor) -> None:
        given: dict[str, Any] = self.rng.choice(
            [
                {"value": float(self.rng.randrange(1, 20))},
                {"instrument": self.rng.choice(INSTRUMENTS)},
                {"must_do": self.rng.random() < 0.5, "notes": str(self.rng.randrange(100))},
                {"window_s": [0.0, float(self.rng.randrange(1, 9000))]},
            ]
        )
        request = self.one(ObservationRequestRow)
        self.set(who, "observation_request", request, ObservationRequestChange(**given))

    def order(self, who: Actor) -> None:
        after = sorted({self.one(ObservationRequestRow) for _ in range(self.rng.randrange(3))})
        request = self.one(ObservationRequestRow)
        self.set(who, "observation_request", request, ObservationRequestChange(after=after))

    def drop_request(self, who: Actor) -> None:
        kind = KINDS["observation_request"]
        delete_resource(self.repo, who, kind, self.one(ObservationRequestRow), None)

    def _corners(self) -> list[list[float]]:
        x, y = self.place(), self.place()
        return [[x, y], [x + 1.0, y], [x, y + 1.0]]

    def keep_out(self, who: Actor) -> None:
        create_keep_out(self.repo, who, self.mission_id, KeepOutCreate(polygon_m=self._corners()))

    def redraw(self, who: Actor) -> None:
        given = KeepOutChange(polygon_m=self._corners())
        self.set(who, "keep_out", self.one(KeepOutRow), given)

    def drop_keep_out(self, who: Actor) -> None:
        delete_resource(self.repo, who, KINDS["keep_out"], self.one(KeepOutRow), None)

    def sol(self, who: Actor) -> None:
        create_sol(self.repo, who, self.mission_id, SolCreate(number=self.rng.randrange(8)))

    def budget(self, who: Actor) -> None:
        given: dict[str, Any] = self.rng.choice(
            [{"number": self.rng.randrange(8)}, {"battery_j": float(self.rng.randrange(1, 10**6))}]
        )
        self.set(who, "sol", self.one(SolRow), SolChange(**given))

    def drop_sol(self, who: Actor) -> None:
        delete_resource(self.repo, who, KINDS["sol"], self.one(SolRow), None)

    def rule(self, who: Actor) -> None:
        rules = [{"from_target_id": None, "to_target_id": self.one(TargetRow), "via_m": None}]
        given = MissionChange.model_validate({"drive_rules": rules[: self.rng.randrange(2)]})
        self.set(who, "mission", self.mission_id, given)

    def frame(self, who: Actor) -> None:
        if not self.anchor:
            given = FrameCreate(name="SITE_FRAME", counter=[1])
            self.anchor = create_frame(self.repo, who, self.mission_id, given).id
            return
        given = FrameCreate(name="ROVER_FRAME", counter=[1, self.rng.randrange(9)])
        made = create_frame(self.repo, who, self.mission_id, given)
        for _ in range(2):
            offset = [self.rng.uniform(-3.0, 3.0), self.rng.uniform(-3.0, 3.0), 0.0]
            solution = GivenSolution("telemetry", self.anchor, offset, [1.0, 0.0, 0.0, 0.0])
            add_solution(self.repo, who, made.id, solution)

    def tie(self, who: Actor) -> None:
        frame = self.rng.choice([None, self.one(KINDS["frame"].row)])
        self.set(who, "target", self.one(TargetRow), TargetChange(frame_id=frame))

    def choose(self, who: Actor) -> None:
        row: Any = KINDS["solution"].row
        solution = self.one(row)
        with self.repo.database.read() as session:
            frame = session.get_one(row, solution).frame_id
        choose_solution(self.repo, who, frame, self.rng.choice([solution, solution, None]), None)


@dataclass(frozen=True)
class Event:
    """What the judge looks at."""

    seq: int
    group: str
    kind: str
    subject: str
    before: dict[str, Any]
    after: dict[str, Any]

    @property
    def set(self) -> set[str]:
        names = self.before.keys() | self.after.keys()
        whole = not self.before or not self.after
        found = {n for n in names if whole or self.before.get(n) != self.after.get(n)}
        return found - {"revision", "modified_utc"}


def acts_of(repo: Repository, mission_id: str, behind: int) -> dict[str, list[Event]]:
    """Return the events behind one, by act."""
    found: dict[str, list[Event]] = {}
    with repo.database.read() as session:
        query = select(EventRow).where(EventRow.chain_id == mission_id, EventRow.seq > behind)
        for e in session.scalars(query.order_by(EventRow.seq)):
            event = Event(e.seq, e.group, e.kind, e.subject_id, e.before or {}, e.after or {})
            found.setdefault(e.group, []).append(event)
    return found


def rests_on(later: list[Event], act: list[Event]) -> bool:
    """Return whether a later act would not be what it is without another, judged from their events alone."""
    for a in act:
        for b in later:
            text = orjson.dumps({n: b.after.get(n) for n in b.set}).decode()
            same = a.subject == b.subject and a.set & b.set
            refers = not a.before and a.subject in text
            gone = not b.after and b.subject in orjson.dumps(a.before).decode()
            takes = a.kind == b.kind and any(
                n in b.set and a.before.get(n) == b.after.get(n) and a.before.get(n) is not None
                for n in ("name", "number", "key")
            )
            place = {"east_m", "north_m"} & a.set and "observation_point" in b.set
            stand = place and a.subject in (b.after.get("target_id"), b.before.get("target_id"))
            tied = (
                a.kind == "frame"
                and "solution_id" in a.set
                and (b.after.get("frame_id") or b.before.get("frame_id"))
            )
            circle = "after" in a.set & b.set and a.kind == b.kind
            if same or refers or gone or takes or stand or tied or circle:
                return True
    return False


def study(repo: Repository, acts: int, seed: int) -> Counter[str]:
    """Return the counts of one mission's acts, undos, refusals, and of what should not be."""
    rng = random.Random(seed)
    ensure_profiles(repo)
    source = GeneratedTerrain(seed=seed % 1000, size_m=48.0, rock_cover=0.0)
    mission = create_mission(repo, PEOPLE[0], name="Study", source=source)
    hand = Hand(repo, mission.id, rng)
    with repo.database.read() as session:
        behind = len(session.scalars(select(EventRow.seq).where(EventRow.chain_id == mission.id)).all())
    first = digest(repo, mission.id)
    while sum(hand.done.values()) - hand.done["refused"] < acts:
        hand.act()
    made = acts_of(repo, mission.id, behind)
    found: Counter[str] = Counter(acts=len(made), refused_by_the_rules=hand.done["refused"])
    pending = list(made)
    group_at = {event.seq: group for group, events in made.items() for event in events}
    waits: dict[str, list[str]] = {}
    began = time.process_time()
    while pending:
        group = pending.pop(rng.randrange(len(pending)))
        try:
            undo(repo, PEOPLE[1], mission.id, anyone=True, event=rng.choice(made[group]).seq)
        except StateError as err:
            found["undos refused"] += 1
            named = group_at.get(int(err.extra.get("event", 0)))
            if named is None or not rests_on(made[named], made[group]):
                found["refusals without a true reason"] += 1
                print(err)
            if named is None:
                continue
            waits.setdefault(named, []).append(group)
            continue
        found["undone"] += 1
        pending += waits.pop(group, [])
    found["never undone"] = sum(map(len, waits.values()))
    found["processor ms an undo"] = round(
        1000 * (time.process_time() - began) / max(1, found["undone"] + found["undos refused"])
    )
    found["another mission than at first"] = int(digest(repo, mission.id) != first)
    with repo.database.read() as session:
        found["faults of the chain"] = len(verify_chains(session)[1])
    return found


BAD = (
    "refusals without a true reason",
    "never undone",
    "another mission than at first",
    "faults of the chain",
)


def main() -> None:
    """Print the counts; end with 1 if anything is not as it was."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--acts", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument("--database", default="", help="empty = SQLite in a folder of its own")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="outcrop-undo-") as folder:
        repo = open_repository(load_settings(data_dir=Path(folder), database_url=asked.database))
        migrate(repo.database)
        found = study(repo, asked.acts, asked.seed)
        repo.database.dispose()
    print(f"seed {asked.seed}: {dict(found)}")
    raise SystemExit(1 if any(found[name] for name in BAD) else 0)


if __name__ == "__main__":
    main()
