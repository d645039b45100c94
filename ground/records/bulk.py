"""Many resources of one kind made, changed and deleted as one act: every row, or none and what is wrong."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Any

from pydantic import Field, create_model
from sqlalchemy.orm import Session

from ground.errors import ForbiddenError, GroundError, InvalidInputError, NotFoundError
from ground.gdr.history import batched, hold_chain
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.change_resource import change_resource, prepare_change
from ground.records.delete_resource import delete_resource
from ground.records.forms import Body, Id
from ground.records.get_resource import mission_of, require_mission
from ground.records.kind import Kind, Prepared

MAX_ROWS = 10_000
Make = Callable[..., Any]
"""The use case by which one is made, of repository, actor, mission and form."""
Revision = Annotated[
    Annotated[int, Field(strict=True, ge=1, le=2**31 - 1)] | None,
    Field(description="the one that was seen; null for whatever stands there"),
]


class DeleteRow(Body):
    """One that is to go."""

    id: Id
    revision: Revision


@dataclass(frozen=True, slots=True)
class WrittenRow:
    """One that was made or changed."""

    id: str
    revision: int


@dataclass(frozen=True, slots=True)
class BulkDone:
    """What was done, in the order of the rows."""

    created: list[WrittenRow] = field(default_factory=list)
    updated: list[WrittenRow] = field(default_factory=list)
    deleted: list[str] = field(default_factory=list)


@lru_cache(maxsize=64)
def bulk_form(kind: Kind[Any]) -> type[Body]:
    """Return the form with rows of a kind to make, change and delete."""
    assert kind.make is not None
    assert kind.change is not None
    name = kind.value.__name__
    update: Any = create_model(
        f"{name}UpdateRow", __base__=Body, id=(Id, ...), revision=(Revision, ...), changes=(kind.change, ...)
    )

    def rows(row: Any) -> Any:
        return Annotated[list[row], Field(default_factory=list, max_length=MAX_ROWS)]

    form: Any = create_model(
        f"{name}Bulk",
        __base__=Body,
        __doc__=f"Rows to delete, change and make, in this order; at most {MAX_ROWS} together.",
        create=(rows(kind.make), ...),
        update=(rows(update), ...),
        delete=(rows(DeleteRow), ...),
    )
    made: type[Body] = form
    return made


def write_many(
    repo: Repository, actor: Actor, kind: Kind[Any], mission_id: str, make: Make, given: Any
) -> BulkDone:
    """Return what was done with the rows of a `bulk_form`: those to delete, then to change, then to make.

    They are one transaction and one act for undo.

    Raises
    ------
    InvalidInputError
        If there are too many rows, or any cannot be used; then nothing is done and each of those is named.
    """
    actor.require(kind.edit, mission_id)
    count = len(given.create) + len(given.update) + len(given.delete)
    if count > MAX_ROWS:
        raise InvalidInputError(f"{count} rows; at most {MAX_ROWS} are one act", pointer="/create")
    done, wrong = BulkDone(), _Wrong(count)
    ready, foreseen = _prepared(repo, actor, kind, mission_id, given)
    with repo.database.whole() as session, batched(session):
        require_mission(session, mission_id)
        hold_chain(session, mission_id)
        for number, row in enumerate(given.delete):
            with wrong.of(f"/delete/{number}"):
                _require_here(session, kind, row.id, mission_id)
                delete_resource(repo, actor, kind, row.id, row.revision)
                done.deleted.append(row.id)
        for number, row in enumerate(given.update):
            with wrong.of(f"/update/{number}", "/changes"):
                _require_here(session, kind, row.id, mission_id)
                value = change_resource(
                    repo, actor, kind, row.id, row.changes, row.revision, prepared=ready.get(number)
                )
                done.updated.append(WrittenRow(value.id, value.revision))
        for number, row in enumerate(given.create):
            with wrong.of(f"/create/{number}"):
                known = {} if kind.foresee is None else {"foreseen": foreseen[number]}
                value = make(repo, actor, mission_id, row, **known)
                done.created.append(WrittenRow(value.id, value.revision))
        wrong.refuse()
    return done


def _prepared(
    repo: Repository, actor: Actor, kind: Kind[Any], mission_id: str, given: Any
) -> tuple[dict[int, tuple[Body, Prepared]], Sequence[Any]]:
    """Return what the changes and what the new rows need that takes long: the database is not held for it.

    What cannot be worked out is left for the act, which names the row that is wrong.
    """
    with repo.database.read() as session:
        require_mission(session, mission_id)
    ready: dict[int, tuple[Body, Prepared]] = {}
    for number, row in enumerate(given.update):
        with suppress(GroundError):
            ready[number] = prepare_change(repo, actor, kind, row.id, row.changes)
    return ready, [] if kind.foresee is None else kind.foresee(repo, mission_id, given.create)


def _require_here(session: Session, kind: Kind[Any], identifier: str, mission_id: str) -> None:
    row = session.get(kind.row, identifier)
    if row is None or mission_of(row) != mission_id:
        raise NotFoundError(f"there is no {kind.title} {identifier} in mission {mission_id}")


class _Wrong:
    """Gathers what is wrong with rows."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._found: list[dict[str, str]] = []

    def of(self, pointer: str, inside: str = "") -> _Row:
        """Return what keeps the error of one row; `inside` is where its form stands in it."""
        return _Row(self._found, pointer, inside)

    def refuse(self) -> None:
        """Raise if any row cannot be used."""
        if not self._found:
            return
        told = "; ".join(f"{w['pointer']}: {w['detail']}" for w in self._found[:3])
        more = f"; and {len(self._found) - 3} more" if len(self._found) > 3 else ""
        raise InvalidInputError(
            f"nothing was done: {len(self._found)} of {self._count} rows cannot be used: {told}{more}",
            wrong=self._found,
        )


@dataclass(frozen=True, slots=True)
class _Row:
    found: list[dict[str, str]]
    pointer: str
    inside: str

    def __enter__(self) -> None:
        pass

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> bool:
        if not isinstance(error, GroundError) or isinstance(error, ForbiddenError):
            return False
        member = error.pointer if error.pointer and error.pointer.startswith("/") else ""
        place = self.pointer + (self.inside + member if member else "")
        self.found.append({"detail": error.message, "pointer": place})
        return True
