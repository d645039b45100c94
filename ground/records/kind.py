"""What a kind of resource declares, and by what it is listed, read, changed and undone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from typing import Any

from pydantic import BaseModel
from sqlalchemy import Select, select
from sqlalchemy.orm import Session

from ground.gdr.base import Row
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.forms import Body


@dataclass(frozen=True, slots=True)
class Prepared:
    """What the terrain says to a change, and the revision of the resource for which it does.

    `points` holds the observation point of each request concerned, under its id and instrument.
    """

    revision: int
    columns: Mapping[str, Any] = field(default_factory=dict)
    points: Mapping[tuple[str, str], Mapping[str, Any] | None] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Changed:
    """The columns that a change sets, and those of other rows that follow it."""

    columns: Mapping[str, Any]
    followers: Sequence[tuple[Kind, Any, Mapping[str, Any]]] = ()


Prepare = Callable[[Repository, Session, Any, Any], Prepared]
"""Work out for a row and the form with the members to set what takes long, before the database is locked."""
Apply = Callable[[Repository, Session, Any, Any, Prepared], Changed | None]
"""Check the members to set and return what follows; None if the rows are others than was prepared for."""
Forget = Callable[[Session, Actor, Any, str, str], None]
"""Take a row that is about to go out of what names it; with the act's group and the reason."""


def _nothing_to_prepare(_repo: Repository, _session: Session, row: Row, _members: object) -> Prepared:
    return Prepared(row.revision)


def _as_given(_repo: object, _session: object, _row: object, given: Body, _prepared: object) -> Changed:
    return Changed(given_columns(given))


def given_columns(given: Body) -> dict[str, object]:
    """Return the members that a form names, as columns keep them."""
    return {name: plain(getattr(given, name)) for name in given.model_fields_set}


def plain(value: Any) -> Any:
    """Return a value as a JSON column keeps it."""
    if isinstance(value, BaseModel):
        return value.model_dump()
    if is_dataclass(value) and not isinstance(value, type):
        return asdict(value)
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return getattr(value, "value", value)


@dataclass(frozen=True, slots=True)
class Kind:
    """How one kind of resource is stored and shown.

    `show` maps rows to values, many at once so that names of related rows cost one query; rows of the mapper
    and plain result rows of `shown()` will both do. `edit` is the right needed to change it.
    """

    name: str
    title: str
    prefix: str
    collection: str
    row: type[Row]
    show: Callable[[Any, Sequence[Any]], list[Any]]
    edit: Action
    make: type[Body] | None = None
    """What a person gives to make one."""
    change: type[Body] | None = None
    """What a person may set of one; everything else is computed."""
    undoable: bool = False
    related: bool = False
    """Whether `show` reads other rows too, and so needs a session that sees one state of the database."""
    unseen: frozenset[str] = frozenset()
    """Columns that `show` has no use for; the large ones would cost more than all the others."""

    delete: Action | None = None
    """The right needed to delete it, where that is not `edit`."""
    prepare: Prepare = _nothing_to_prepare
    apply: Apply = _as_given
    forget: tuple[Forget, ...] = ()

    @property
    def fields(self) -> frozenset[str]:
        """Return the members that a person may set."""
        return frozenset(() if self.change is None else self.change.model_fields)

    def shown(self) -> Select[Any]:
        """Return the query for the columns that `show` needs, without conditions."""
        return select(*(c for c in self.row.__table__.c if c.name not in self.unseen))
