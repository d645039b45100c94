"""What a kind of resource declares, and by what it is listed, read, changed and undone."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from typing import Any, Generic, TypeAlias, TypeVar

from pydantic import BaseModel
from sqlalchemy import ColumnElement, Select, select
from sqlalchemy.orm import Session

from ground.gdr.base import Row
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.forms import Body
from ground.records.show import value_of

V = TypeVar("V")


@dataclass(frozen=True, slots=True)
class Prepared:
    """What the terrain says to a change, and the revision of the resource for which it does.

    `points` holds the observation point of each request concerned, under its id and instrument.
    """

    revision: int
    columns: Mapping[str, Any] = field(default_factory=dict)
    points: Mapping[tuple[str, str], Mapping[str, Any] | None] = field(default_factory=dict)


Follower: TypeAlias = "tuple[Kind[Any], Any, Mapping[str, object]]"
"""A row that changes with another, and its new columns."""


@dataclass(frozen=True, slots=True)
class Changed:
    """The columns that a change sets, and those of other rows that follow it."""

    columns: Mapping[str, Any]
    followers: Sequence[Follower] = ()


Settle = Callable[[Session, str, Any], Any]
"""Return a form about a mission with what it gives in another reference put in site metres."""
Locate = Callable[[Any, str | None, Sequence[Any], str], list[Any]]
"""Return values of a mission that tell where they lie in a reference as well, by its name."""
Prepare = Callable[[Repository, Session, Any, Any], Prepared]
"""Work out for a row and the form with the members to set what takes long, before the database is locked."""
Apply = Callable[[Repository, Session, Any, Any, Prepared], Changed | None]
"""Check the members to set and return what follows; None if the rows are others than was prepared for."""
Related = Callable[[Any, Sequence[Any]], Callable[[Any], Mapping[str, object]]]
"""Read once what belongs to many rows; return what says the related members of each."""
Forget = Callable[[Session, Actor, Any, str], None]
"""Take a row that is about to go out of what names it; with the reason."""


def _nothing_to_prepare(_repo: Repository, _session: Session, row: Row, _members: object) -> Prepared:
    return Prepared(row.revision)


def _as_it_came(_session: Session, _mission_id: str, given: Body) -> Body:
    return given


def _as_given(_repo: object, _session: object, _row: object, given: Body, _prepared: object) -> Changed:
    return Changed(given_columns(given))


def _as_it_is(_actor: Actor, value: Any) -> Any:
    return value


def _all_of_them(_actor: Actor) -> Mapping[str, object]:
    return {}


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


Foresee = Callable[[Repository, str, Sequence[Any]], Sequence[Any]]
"""Work out for forms of a mission, before the database is locked, what making each takes long for."""


@dataclass(frozen=True, slots=True, eq=False)
class Kind(Generic[V]):
    """How one kind of resource is stored and shown; `edit` is the right needed to change it."""

    name: str
    prefix: str
    collection: str
    row: type[Row]
    value: type[V]
    """What is told of one: its members are columns of the same name, but for those below."""
    edit: Action
    title: str = ""
    """What people call one; its name in words unless it is said."""
    make: type[Body] | None = None
    """What a person gives to make one."""
    change: type[Body] | None = None
    """What a person may set of one; everything else is computed."""
    undoable: bool = False
    computed: Mapping[str, Callable[[Any], object]] = field(default_factory=dict)
    """Members of the value that follow from the row."""
    related: Related | None = None
    """Those that follow from other rows too; they are read in a session that sees one state of the database.
    """
    absent: str | None = None
    """The column that is true of rows that are not there for anybody yet."""
    foresee: Foresee | None = None
    """For kinds of which many are made at once; what it returns goes to the use case as `foreseen`."""
    unseen: frozenset[str] = frozenset()
    """Columns that the value has no use for; the large ones would cost more than all the others."""

    delete: Action | None = None
    """The right needed to delete it, where that is not `edit`."""
    settle: Settle = _as_it_came
    prepare: Prepare = _nothing_to_prepare
    apply: Apply = _as_given
    conceal: Callable[[Actor, Any], Any] = _as_it_is
    """Take out of a value what is not for who asks."""
    only: Callable[[Actor], Mapping[str, object]] = _all_of_them
    """Values that columns must have in rows that are there for who asks."""
    forget: tuple[Forget, ...] = ()
    locate: Locate | None = None
    """Where things lie can be told in other references."""
    hold: Callable[[Session, Any], None] | None = None
    """Raise unless a row fits with the others; asked after an undo, whose changes are not a form's."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "title", self.title or self.name.replace("_", " "))

    @property
    def fields(self) -> frozenset[str]:
        """Return the members that a person may set."""
        return frozenset(() if self.change is None else self.change.model_fields)

    def shown(self) -> Select[Any]:
        """Return the query for the columns that `show` needs, of all rows that are there."""
        columns = self.row.__table__.c
        return select(*(c for c in columns if c.name not in self.unseen)).where(*self.there)

    @property
    def there(self) -> tuple[ColumnElement[bool], ...]:
        """Return the conditions of rows that are there."""
        return () if self.absent is None else (self.row.__table__.c[self.absent].is_(False),)

    def show(self, session: Any, rows: Sequence[Any]) -> list[V]:
        """Return the values of rows of the mapper or of `shown()`."""
        related = None if self.related is None else self.related(session, rows)
        return [
            value_of(
                self.value,
                row,
                **{name: compute(row) for name, compute in self.computed.items()},
                **({} if related is None else related(row)),
            )
            for row in rows
        ]

    def show_one(self, session: Any, row: Any) -> V:
        """Return the value of a row."""
        return self.show(session, [row])[0]
