"""Random edits of a mission and of its copy, merged: no edit is lost without a named conflict.

    .venv/bin/python -m studies.mission_merges --pairs 1000

Two people edit a mission and its copy at random. One is merged into the other, first with no choice, then
with a random side taken in each conflict, until it is joined or refused by name. What has to come of each
edit is judged here from the rows before and after alone, by rules written apart from the program's. A merge
is then taken back and done again, and both missions go on, so that later merges begin at earlier ones.
"""

from __future__ import annotations

import argparse
import random
import secrets
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sqlalchemy import select

from ground.errors import GroundError
from ground.gdr.history import verify_chains
from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.records.actor import Actor
from ground.resources.history.undo import redo, undo
from ground.resources.history.verify_rows import verify_rows
from ground.resources.keep_outs.bodies import KeepOutChange
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.kinds import KINDS
from ground.resources.mission_archives.copy_mission import copy_mission
from ground.resources.mission_merges.bodies import MissionMergeCreate
from ground.resources.mission_merges.merge_missions import merge_missions
from ground.resources.mission_merges.value import MissionConflict, MissionMerge
from ground.resources.mission_setup.create_mission import FolderTerrain, GeneratedTerrain, create_mission
from ground.resources.missions.bodies import MissionChange
from ground.resources.observation_requests.bodies import ObservationRequestChange
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.people.accounts import ensure_profiles
from ground.resources.sols.bodies import SolChange
from ground.resources.sols.row import SolRow
from ground.resources.targets.bodies import TargetChange
from ground.resources.targets.row import TargetRow
from ground.settings import load_settings
from studies.undo_in_any_order import PEOPLE, Hand, digest

Cells = dict[Any, Any]
State = dict[str, Cells]
"""The cells of each row by its id; a row's kind is the cell `kind`."""
TABLES = ("sol", "target", "observation_request", "keep_out", "frame", "solution")
CELLS = {
    "sol": "number notes start_pose start_utc start_lmst_h battery_j energy_floor_j time_budget_s "
    "energy_budget_j overrun_penalty passes uplink_deadline_utc",
    "target": "name notes feature_type source_image",
    "observation_request": "target_id instrument value tracked window_s must_do dwell_s notes rationale",
    "keep_out": "name notes",
    "frame": "key notes solution_id",
    "solution": "label notes offset_m",
}
STUCK = {"circle", "invalid"}
MOST_EDITS = 14
FIRST = {"target": 4, "request": 6, "order": 2, "keep_out": 2, "sol": 2, "drives": 1, "frame": 3}
"""What is there before the copies: few rows, so that edits meet."""
ROUNDS = 2
"""Merges of one copy: the later begins where the earlier ended."""


class Editor(Hand):
    """Somebody who edits a mission or its copy."""

    def act(self) -> None:
        """Do one thing; one that the rules refuse is not an act."""
        deeds: list[Callable[[Actor], object]] = [
            *[self.target] * 2, *[self.move] * 2, *[self.name] * 3, self.drop_target,
            *[self.request] * 3, *[self.change] * 4, *[self.order] * 2, self.drop_request,
            self.keep_out, self.redraw, self.drop_keep_out, self.sol, *[self.budget] * 2, self.drop_sol,
            *[self.words] * 4, *[self.drives] * 2, self.stand, self.carry,
        ]  # fmt: skip
        if self.rng.random() < 0.03:
            deeds = [self.frame, self.tie, self.tie, self.choose]
        self.do(self.rng.choice(deeds))

    def do(self, deed: Callable[[Actor], object]) -> None:
        """Do one thing, or count that the rules refuse it."""
        try:
            deed(self.rng.choice(PEOPLE))
            self.done[deed.__name__] += 1
        except GroundError:
            self.done["refused"] += 1

    def words(self, who: Actor) -> None:
        word = f"w{self.rng.randrange(6)}"
        rationale: dict[str, Any] = {"rationale": word}
        no_window: dict[str, Any] = {"window_s": None}
        kind, row, given = self.rng.choice(
            [
                ("target", TargetRow, TargetChange(feature_type=word)),
                ("observation_request", ObservationRequestRow, ObservationRequestChange(**rationale)),
                ("observation_request", ObservationRequestRow, ObservationRequestChange(**no_window)),
                ("keep_out", KeepOutRow, KeepOutChange(name=word)),
                ("sol", SolRow, SolChange(notes=word)),
                ("mission", None, MissionChange(notes=word)),
            ]
        )
        self.set(who, kind, self.mission_id if row is None else self.one(row), given)

    def drives(self, who: Actor) -> None:
        ends = [self.one(TargetRow), self.rng.choice([None, self.one(TargetRow)])]
        with self.repo.database.read() as session:
            mission: Any = session.get_one(KINDS["mission"].row, self.mission_id)
            rules = list(mission.drive_rules or [])
        if rules and self.rng.random() < 0.4:
            rules.pop(self.rng.randrange(len(rules)))
        else:
            rules = [r for r in rules if {r["from_target_id"], r["to_target_id"]} != set(ends)]
            via = self.rng.choice([None, [], [[self.place(), self.place()], [0.0, 1.0]]])
            rules.append({"from_target_id": ends[1], "to_target_id": ends[0], "via_m": via})
        given = MissionChange.model_validate({"drive_rules": rules})
        self.set(who, "mission", self.mission_id, given)

    def stand(self, who: Actor) -> None:
        pose = {"east_m": self.place(), "north_m": self.place(), "heading_rad": 0.5}
        given = {"observation_pose": self.rng.choice([pose, None])}
        request = self.one(ObservationRequestRow)
        self.set(who, "observation_request", request, ObservationRequestChange.model_validate(given))

    def carry(self, who: Actor) -> None:
        given: dict[str, Any] = {"state": self.rng.choice(["open", "carried"])}
        request = self.one(ObservationRequestRow)
        self.set(who, "observation_request", request, ObservationRequestChange(**given))


# ---- the judge: rows alone


def state_of(repo: Repository, mission_id: str) -> State:
    """Return what people set in a mission, by the ids of its rows."""
    found: State = {}
    with repo.database.read() as session:
        for kind in TABLES:
            rows: Any = KINDS[kind].row
            for row in session.scalars(select(rows).where(rows.mission_id == mission_id)):
                cells = {name: getattr(row, name) for name in CELLS[kind].split()}
                if kind in {"target", "keep_out"}:
                    cells["place"] = _place(row, kind)
                if kind == "observation_request":
                    point = row.observation_point
                    cells["after"] = list(row.after)
                    cells["constraints"] = row.constraints or []
                    cells["observation_pose"] = point["pose"] if point and point["manual"] else None
                    cells["state"] = row.state
                found[row.id] = {"kind": kind, **cells}
        mission: Any = session.get_one(KINDS["mission"].row, mission_id)
        names = ("notes", "rover_profile", "calibration", "place", "anchor_frame_id")
        found[mission_id] = {"kind": "mission", **{n: getattr(mission, n) for n in names}}
        for rule in mission.drive_rules or []:
            ends = (rule["from_target_id"] or "", rule["to_target_id"])
            corners = None if rule["via_m"] is None else tuple(map(tuple, rule["via_m"]))
            # As seen from either end: ids may get another order when a target is made anew.
            via = None if corners is None else frozenset({(ends[0], corners), (ends[1], corners[::-1])})
            found[mission_id]["drive", frozenset(ends)] = {"via": via}
    return found


def _place(row: Any, kind: str) -> object:
    if row.frame_id is None:
        return (None, (row.east_m, row.north_m) if kind == "target" else row.polygon_m)
    seen = row.in_frame["position_m" if kind == "target" else "outline_m"]
    flat = [x for c in seen for x in c] if isinstance(seen[0], list) else seen
    return (row.frame_id, tuple(round(x, 5) for x in flat))


def renamed(found: Any, ids: dict[str, str]) -> Any:
    """Return a value with other ids in it."""
    if isinstance(found, str):
        return ids.get(found, found)
    if isinstance(found, dict):
        return {renamed(k, ids): renamed(v, ids) for k, v in found.items()}
    if isinstance(found, tuple | frozenset):
        return type(found)(renamed(part, ids) for part in found)
    return [renamed(part, ids) for part in found] if isinstance(found, list) else found


@dataclass
class Pair:
    """A mission and its copy, and what they had in common last."""

    repo: Repository
    sides: tuple[str, str]
    to_first: dict[str, str]
    """Ids in the first mission by those in the second."""
    base: State
    """By ids of the first."""
    found: Counter[str]
    renewed: dict[str, str] = field(default_factory=dict)
    """Ids in the first mission of rows that were gone and brought back, by those before."""
    faults: list[str] = field(default_factory=list)

    def in_first(self, side: int) -> State:
        state = state_of(self.repo, self.sides[side])
        return renamed(state, self.to_first) if side else state

    def fault(self, text: str) -> None:
        self.faults.append(text)
        self.found["faults"] += 1


def judge(pair: Pair, states: tuple[State, State, State, State], named: dict[Any, str | None]) -> None:
    """Check each edit against what the merge made of it.

    `named` has the side that was taken in each conflict, by kind, id and field.
    """
    base, ours, theirs, merged = states
    about: dict[str, set[tuple[str, str]]] = {}
    for kind, identifier, name in named:
        about.setdefault(identifier, set()).add((kind, name))
    referring = {i for kind, i, _ in named if kind == "refers-to-removed"}
    spoken = {
        other for i in referring for side in (base, ours, theirs) for other in _mentioned(side.get(i, {}))
    }  # what a named conflict about another row is about
    same_names = [i for kind, i, _ in named if kind == "same-name"]
    shared = {
        (side[i]["kind"], name, side[i].get(name))
        for i in same_names
        for side in (ours, theirs)
        if i in side
        for name in ("name", "number")
    }
    for identifier in sorted({*base, *ours, *theirs, *merged}):
        b, o, t, m = (side.get(identifier) for side in (base, ours, theirs, merged))
        marks = about.get(identifier, set())
        free = identifier in referring or identifier in spoken
        if (o or t or b or {}).get("kind") in {"frame", "solution"}:
            pair.found["edits"] += int(t not in (b, o))
            if m != o or (t not in (b, o) and ("not-merged", "") not in marks):
                pair.fault(f"{identifier}: site changed by theirs without a word: {b} {o} {t} {m}")
            continue
        _judge_row(pair, identifier, (b, o, t, m), marks, named, free, shared)


def _mentioned(cells: Cells) -> set[str]:
    found = {cells.get("target_id"), *cells.get("after", [])}
    for name in cells:
        if isinstance(name, tuple):
            found |= set(name[1])
    return {i for i in found if i}


Sides = tuple[Cells | None, Cells | None, Cells | None, Cells | None]
"""One row in base, ours, theirs and merged."""


def _judge_row(
    pair: Pair,
    identifier: str,
    sides: Sides,
    marks: set[tuple[str, str]],
    named: dict[Any, str | None],
    free: bool,
    shared: set[Any],
) -> None:
    b, o, t, m = sides
    if b is not None and (o is None or t is None):
        _judge_removal(pair, identifier, sides, marks, named, free)
        return
    added = b is None and (o is None) != (t is None)
    pair.found["edits"] += int(added)
    if m is None:
        if not free:
            pair.fault(f"{identifier}: {'added, and lost' if added else 'gone, and nobody removed it'}")
        return
    before, our, their = b or o or t or {}, o or t or {}, t or o or {}
    for name in sorted({*before, *our, *their, *m}, key=str):
        three = before.get(name), our.get(name), their.get(name)
        pair.found["edits"] += int(three[1] != three[0]) + int(three[2] != three[0])
        wanted = _wanted(pair, identifier, name, three, named)
        if wanted is CONFLICT or m.get(name) == wanted:
            continue
        refers = any(kind == "refers-to-removed" and f.startswith(_word(name)) for kind, f in marks)
        renamed_one = name in {"name", "number"} and (m["kind"], name, wanted) in shared
        if not refers and not renamed_one:
            pair.fault(f"{identifier} {name}: lost: {three} became {m.get(name)}")


CONFLICT = object()


def _wanted(
    pair: Pair, identifier: str, name: Any, three: tuple[Any, Any, Any], named: dict[Any, str | None]
) -> Any:
    """Return what has to come of a cell; `CONFLICT` where that is not named."""
    conflict = _find(named, "both-changed", identifier, _word(name), name)
    if three[1] != three[2] and three[0] not in three[1:]:
        if conflict is None:
            pair.fault(f"{identifier} {name}: both changed, and no conflict says so: {three}")
            return CONFLICT
        return three[1] if conflict == "ours" else three[2]
    if conflict is not None:
        pair.fault(f"{identifier} {name}: a conflict that is none: {three}")
    return three[2] if three[1] == three[0] else three[1]


def _judge_removal(
    pair: Pair,
    identifier: str,
    sides: Sides,
    marks: set[tuple[str, str]],
    named: dict[Any, str | None],
    free: bool,
) -> None:
    b, o, t, m = sides
    left = o if o is not None else t
    pair.found["edits"] += 1
    wanted: Cells | None = None
    if left is not None and left != b:
        taken = named.get(("removed-and-changed", identifier, ""))
        if taken is None:
            pair.fault(f"{identifier}: removed and changed, and no conflict says so")
        wanted = o if taken == "ours" else t
    elif ("removed-and-changed", "") in marks:
        pair.fault(f"{identifier}: said to be changed, and is not")
    if (m is None) != (wanted is None) and not free:
        pair.fault(f"{identifier}: is {'gone' if m is None else 'here'} without a conflict")


def _word(name: Any) -> str:
    return "drive " if isinstance(name, tuple) else str(name)


def _find(named: dict[Any, str | None], kind: str, identifier: str, word: str, name: Any) -> str | None:
    if not isinstance(name, tuple):
        return named.get((kind, identifier, word))
    for (found, i, f), side in named.items():
        if (found, i) == (kind, identifier) and f.startswith(word):
            first, last = f.removeprefix(word).split(" ")
            if frozenset((first, last)) == name[1]:
                return side
    return None


# ---- merging at random


def keyed(conflict: MissionConflict) -> tuple[str, str, str]:
    """Return what names a conflict."""
    return (conflict.kind, conflict.id, conflict.field)


def merge_once(pair: Pair, into: int, rng: random.Random) -> None:
    """Merge one of the missions into the other, and judge it."""
    repo, mission_id, from_id = pair.repo, pair.sides[into], pair.sides[1 - into]
    before = digest(repo, mission_id), digest(repo, from_id)
    ours, theirs = pair.in_first(into), pair.in_first(1 - into)
    into_first = pair.to_first if into else {}

    def asked(**more: Any) -> MissionMerge:
        given = MissionMergeCreate.model_validate({"from_id": from_id, **more})
        return merge_missions(repo, PEOPLE[0], mission_id, given)

    seen = asked(preview=True)
    chosen: dict[tuple[str, str, str], str] = {}
    for _ in range(20):
        open_ones = [c for c in seen.conflicts if keyed(c) not in chosen and c.kind not in STUCK]
        if not open_ones:
            break
        for conflict in open_ones:
            side = "ours" if conflict.kind == "not-merged" else rng.choice(["ours", "theirs"])
            chosen[keyed(conflict)] = side
        choices = [{"kind": k, "id": i, "field": f, "take": side} for (k, i, f), side in chosen.items()]
        seen = asked(preview=True, choices=choices)
    choices = [{"kind": k, "id": i, "field": f, "take": side} for (k, i, f), side in chosen.items()]
    for conflict in seen.conflicts:
        pair.found[f"conflicts {conflict.kind}"] += 1
    done = asked(event=seen.event, from_event=seen.from_event, choices=choices)
    if done.joined != seen.joined:
        pair.fault("the preview said otherwise")
    after = digest(repo, mission_id), digest(repo, from_id)
    if after[1] != before[1] or (done.merge is None and after[0] != before[0]):
        pair.fault("something was written by a merge that was refused, or into the other mission")
    if done.merge is None:
        pair.found["refused by name"] += 1
        if not any(c.kind in STUCK for c in done.conflicts):
            pair.fault(f"refused without a reason: {done.conflicts}")
        return
    pair.found["merged"] += 1
    pair.found["merged without a choice"] += int(not chosen)
    conflicts = {keyed(c) for c in done.conflicts}
    named = {
        (k, into_first.get(i, i), renamed_field(f, into_first)): side
        for (k, i, f), side in chosen.items()
        if (k, i, f) in conflicts
    }
    take_in_pairs(pair, into, done)
    whole = digest(repo, mission_id)
    merged = pair.in_first(into)
    judge(pair, canonical(pair, ours, theirs, merged), canonical_names(pair, named))
    undo(repo, PEOPLE[0], mission_id)
    if digest(repo, mission_id) != before[0]:
        pair.fault("taken back, it is another mission than before")
    redo(repo, PEOPLE[0], mission_id)
    if digest(repo, mission_id) != whole:
        pair.fault("done again, it is another mission than when it was merged")
    pair.base = pair.in_first(1 - into)


def renamed_field(name: str, ids: dict[str, str]) -> str:
    """Return the field of a conflict with other ids in it: that of a drive names targets."""
    return " ".join(ids.get(word, word) for word in name.split(" "))


def take_in_pairs(pair: Pair, into: int, done: MissionMerge) -> None:
    """Learn which rows a merge made of which: whether they are the same is judged."""
    assert done.merge is not None
    with pair.repo.database.read() as session:
        row: Any = session.get_one(KINDS["merge_base"].row, done.merge.id)
        for there, here in row.pairs:
            first, second = (there, here) if into else (here, there)
            if second in pair.to_first and pair.to_first[second] != first:
                pair.renewed[pair.to_first[second]] = first
            for known in [k for k, v in pair.to_first.items() if v == first]:
                del pair.to_first[known]
            pair.to_first[second] = first


def canonical(pair: Pair, ours: State, theirs: State, merged: State) -> tuple[State, State, State, State]:
    """Return base, ours, theirs and merged under the ids of now, each row's own words aside."""
    ids = {**pair.to_first, **pair.renewed}
    base, ours, theirs = (renamed(side, ids) for side in (pair.base, ours, theirs))
    first, second = pair.sides
    for side in (base, ours, theirs, merged):
        if second in side:
            side[first] = side.pop(second)
    return base, ours, theirs, merged


def canonical_names(pair: Pair, named: dict[Any, str]) -> dict[Any, str | None]:
    """Return the sides that were taken, under the ids of now."""
    ids = {**pair.to_first, **pair.renewed, pair.sides[1]: pair.sides[0]}
    return {(k, ids.get(i, i), renamed_field(f, ids)): side for (k, i, f), side in named.items()}


def copied(repo: Repository, mission_id: str, name: str) -> tuple[str, dict[str, str]]:
    """Return a copy, and the ids in the mission by those in it."""
    copy = copy_mission(repo, PEOPLE[0], mission_id, name=name).id
    rows: Any = KINDS["merge_base"].row
    with repo.database.read() as session:
        pairs = session.scalars(select(rows.pairs).where(rows.mission_id == copy)).one()
    return copy, {second: first for first, second in pairs}


def opened(repo: Repository, source: str, found: Counter[str]) -> Pair:
    """Return a mission and its copy that nobody has edited."""
    first, _ = copied(repo, source, "Mission")
    second, to_first = copied(repo, first, "What if")
    pair = Pair(repo, (first, second), {**to_first, second: first}, {}, found)
    pair.base = pair.in_first(0)
    if pair.in_first(1) != pair.base:
        pair.fault("the copy is not what it was copied from")
    return pair


def pairs_of(
    repo: Repository, source: str, count: int, rng: random.Random, found: Counter[str]
) -> Iterator[Pair]:
    """Yield each pair after its merges."""
    hands = Editor(repo, source, rng)
    for deed, times in FIRST.items():
        while hands.done[deed] < times:
            hands.do(getattr(hands, deed))
    made = 0
    while made < count:
        pair = opened(repo, hands.mission_id, found)
        editors = [Editor(repo, side, rng) for side in pair.sides]
        for editor in editors:
            with repo.database.read() as session:
                mission: Any = session.get_one(KINDS["mission"].row, editor.mission_id)
                editor.anchor = mission.anchor_frame_id or ""
        for _ in range(min(ROUNDS, count - made)):
            for editor in editors:
                for _ in range(rng.randrange(MOST_EDITS)):
                    editor.act()
            merge_once(pair, rng.randrange(2), rng)
            made += 1
        yield pair


def study(
    repo: Repository, pairs: int, seed: int, ground: GeneratedTerrain | FolderTerrain | None = None
) -> tuple[Counter[str], list[str]]:
    """Return the counts of merges, edits and conflicts, and what should not be."""
    ensure_profiles(repo)
    found: Counter[str] = Counter()
    faults: list[str] = []
    began = time.process_time()
    ground = ground or GeneratedTerrain(seed=seed % 1000, size_m=48.0, rock_cover=0.0)
    source = create_mission(repo, PEOPLE[0], name="Source", source=ground).id
    for pair in pairs_of(repo, source, pairs, random.Random(seed), found):
        faults += pair.faults
    found["pairs"] = pairs
    found["processor s"] = round(time.process_time() - began)
    with repo.database.read() as session:
        found["faults of the chain"] = len(verify_chains(session)[1])
        found["faults of rows"] = len(verify_rows(session).faults)
    return found, faults


BAD = ("faults", "faults of the chain", "faults of rows")


def main() -> None:
    """Print the counts; end with 1 if an edit was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--pairs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    parser.add_argument("--database", default="", help="empty = SQLite in a folder of its own")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="outcrop-merges-") as folder:
        repo = open_repository(load_settings(data_dir=Path(folder), database_url=asked.database))
        migrate(repo.database)
        found, faults = study(repo, asked.pairs, asked.seed)
        repo.database.dispose()
    for fault in faults[:20]:
        print(fault)
    print(f"seed {asked.seed}: {dict(sorted(found.items()))}")
    raise SystemExit(1 if any(found[name] for name in BAD) else 0)


if __name__ == "__main__":
    main()
