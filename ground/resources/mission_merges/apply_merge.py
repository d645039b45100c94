"""Write what a merge changes: by the use cases of people's own changes, with their rules and rights."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from typing import Any

from sqlalchemy.orm import Session

from ground.errors import ForbiddenError, GroundError
from ground.gdr.base import Columns
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.change_resource import change_resource, prepare_change
from ground.records.delete_resource import delete_resource
from ground.records.forms import Body
from ground.records.kind import Kind, Prepared
from ground.resources.keep_outs.create_keep_out import create_keep_out
from ground.resources.kinds import KINDS
from ground.resources.mission_merges.compared import DRIVE, MERGED, references
from ground.resources.mission_merges.forms import (
    drive_rules_of,
    form_of,
    in_order,
    in_turn,
    members_of,
)
from ground.resources.mission_merges.read_sides import Sides
from ground.resources.missions.bodies import MissionChange
from ground.resources.observation_requests.create_request import create_request
from ground.resources.sols.create_sol import create_sol
from ground.resources.targets.create_target import create_target
from ground.versions.rows import Fields, Key, RowConflict, RowConflictKind, Rows, Schema

MAKE = {
    "sol": create_sol,
    "target": create_target,
    "keep_out": create_keep_out,
    "observation_request": create_request,
}
REMOVED = ("observation_request", "target", "keep_out", "sol")
"""Kinds in the order in which they go: what refers goes first."""


@dataclass(slots=True)
class Plan:
    """What a merge writes: rows that go, change and come, and what was worked out before."""

    removed: list[Key]
    changed: dict[Key, Columns]
    added: dict[Key, Fields]
    ready: dict[Key, tuple[Body, Prepared]] = field(default_factory=dict)
    foreseen: dict[Key, Any] = field(default_factory=dict)


def plan_of(repo: Repository, actor: Actor, session: Session, sides: Sides, merged: Rows) -> Plan:
    """Return what makes the merged rows of ours, with what takes long worked out: nothing is locked yet.

    What cannot be worked out is left for the act, which names the row that is wrong.
    """
    ours = sides.ours
    plan = Plan([key for key in ours if key not in merged], {}, {})
    for key, row in merged.items():
        if key[0] not in MERGED:
            continue
        if key not in ours:
            plan.added[key] = row
        else:
            changes = {name: found for name, found in row.items() if found != ours[key].get(name)}
            if changes:
                plan.changed[key] = changes
    for key, fields in plan.changed.items():
        kind = KINDS[key[0]]
        with suppress(GroundError):
            form = _change(session, sides.mission_id, kind, key, _plain(fields), {})
            plan.ready[key] = prepare_change(repo, actor, kind, key[1], form)
    new = [key for key in plan.added if key[0] == "target"]
    with suppress(GroundError):
        forms = [_create(session, sides.mission_id, key, plan.added[key], {}) for key in new]
        foresee = KINDS["target"].foresee
        assert foresee is not None
        plan.foreseen = dict(zip(new, foresee(repo, sides.mission_id, forms), strict=True))
    return plan


def _plain(fields: Columns) -> Columns:
    """Return changes without those that wait until everything is there: orders and drives."""
    return {name: found for name, found in fields.items() if name != "after" and not name.startswith(DRIVE)}


def _change(
    session: Session, mission_id: str, kind: Kind[Any], key: Key, fields: Fields, ids: Mapping[str, str]
) -> Body:
    assert kind.change is not None
    return form_of(kind.change, members_of(session, mission_id, key, fields, ids))


def _create(session: Session, mission_id: str, key: Key, fields: Fields, ids: Mapping[str, str]) -> Body:
    form = KINDS[key[0]].make
    assert form is not None
    members = members_of(session, mission_id, key, fields, ids)
    return form_of(form, {name: found for name, found in members.items() if name != "state"})


@dataclass(slots=True)
class Applied:
    """What applying a merge did: ids of what was made, and what the rules of the mission refuse."""

    ids: dict[str, str] = field(default_factory=dict)
    wrong: list[RowConflict] = field(default_factory=list)


@dataclass(slots=True)
class Writer:
    """One merge being written, in a transaction that is open."""

    repo: Repository
    actor: Actor
    session: Session
    sides: Sides
    merged: Rows
    schema: Schema
    plan: Plan
    done: Applied = field(default_factory=Applied)

    def write(self) -> Applied:
        """Remove, change and make rows; return what was made and what is refused: then all has to go back."""
        mission = ("mission", self.sides.mission_id)
        changed = self.plan.changed
        if mission in changed:
            self._set(mission, _plain(changed[mission]))
        orders = {key: fields["after"] for key, fields in changed.items() if "after" in fields}
        for key, after in orders.items():
            before = references(key, "after", self.sides.ours[key]["after"])
            kept = [i for _, i in before if i in after]
            self._set(key, {"after": kept})
        for kind in REMOVED:
            for key in self.plan.removed:
                if key[0] == kind:
                    with self._naming(key):
                        delete_resource(self.repo, self.actor, KINDS[kind], key[1], None)
        self._change_rows()
        for kind in MAKE:
            new = {key: row for key, row in self.plan.added.items() if key[0] == kind}
            for key in in_order(new) if kind == "observation_request" else sorted(new):
                self._make(key, new[key])
        for key, after in orders.items():
            self._set(key, {"after": after})
        if any(name.startswith(DRIVE) for name in changed.get(mission, {})):
            with self._naming(mission):
                rules = drive_rules_of(self.merged[mission], self.done.ids)
                form = form_of(MissionChange, {"drive_rules": rules})
                change_resource(self.repo, self.actor, KINDS["mission"], mission[1], form, None)
        return self.done

    def _change_rows(self) -> None:
        ours, removed = self.sides.ours, set(self.plan.removed)
        for kind in MAKE:
            updates = {
                key: _plain(fields)
                for key, fields in self.plan.changed.items()
                if key[0] == kind and _plain(fields)
            }
            name = self.schema.unique.get(kind)
            turns: Iterator[tuple[Key, Columns]] = iter(updates.items())
            if name is not None:
                held = {row[name]: key for key, row in ours.items() if key[0] == kind and key not in removed}
                turns = in_turn(updates, held, name)
            for key, fields in turns:
                self._set(key, fields, self.plan.ready.get(key) if fields == updates[key] else None)

    def _set(self, key: Key, fields: Columns, ready: tuple[Body, Prepared] | None = None) -> None:
        if not fields:
            return
        kind = KINDS[key[0]]
        with self._naming(key):
            if ready is None:
                form = _change(self.session, self.sides.mission_id, kind, key, fields, self.done.ids)
            else:
                form = ready[0]
            where = self.done.ids.get(key[1], key[1])
            change_resource(self.repo, self.actor, kind, where, form, None, prepared=ready)

    def _make(self, key: Key, row: Fields) -> None:
        make: Any = MAKE[key[0]]
        with self._naming(key):
            form = _create(self.session, self.sides.mission_id, key, row, self.done.ids)
            more = {"foreseen": self.plan.foreseen[key]} if key in self.plan.foreseen else {}
            self.done.ids[key[1]] = make(self.repo, self.actor, self.sides.mission_id, form, **more).id
            if row.get("state") == "carried":
                self._set(key, {"state": "carried"})

    @contextmanager
    def _naming(self, key: Key) -> Iterator[None]:
        """Name the row whose change the mission's rules refuse; a right that is missing refuses all."""
        try:
            yield
        except ForbiddenError:
            raise
        except GroundError as err:
            row = self.merged.get(key) or self.sides.ours.get(key) or {}
            name = self.schema.name(key, row)
            self.done.wrong.append(RowConflict(RowConflictKind.INVALID, key, name, theirs=err.message))
