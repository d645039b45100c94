"""What all tables of the repository share.

Every resource has a `revision` that grows by one with each change (the optimistic lock) and is written
together with an event in the same transaction. Composite values (poses, polygons, labels) are JSON.
"""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Annotated, Any, ClassVar, cast, get_args

from sqlalchemy import (
    JSON,
    BigInteger,
    Boolean,
    DateTime,
    Float,
    ForeignKey,
    Integer,
    MetaData,
    String,
    Table,
    Text,
)
from sqlalchemy.engine import Dialect
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column
from sqlalchemy.types import TypeDecorator

CONVENTION = {
    "ix": "ix_%(column_0_label)s",
    "uq": "uq_%(table_name)s_%(column_0_N_name)s",
    "ck": "ck_%(table_name)s_%(constraint_name)s",
    "fk": "fk_%(table_name)s_%(column_0_name)s",
    "pk": "pk_%(table_name)s",
}


Columns = dict[str, Any]
"""Columns of a row, by name."""


class Utc(TypeDecorator[datetime]):
    """An aware UTC time on every database."""

    impl = DateTime(timezone=True)
    cache_ok = True

    @property
    def python_type(self) -> type[Any]:
        return datetime

    def process_bind_param(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        if value is None:
            return None
        value = value.astimezone(UTC)
        return value.replace(tzinfo=None) if dialect.name == "sqlite" else value

    def process_result_value(self, value: datetime | None, dialect: Dialect) -> datetime | None:
        del dialect
        if value is None:
            return None
        return value.replace(tzinfo=UTC) if value.tzinfo is None else value.astimezone(UTC)


class JsonObject(JSON[Columns]):
    """A JSON object, and never another value."""

    @property
    def python_type(self) -> type[Any]:
        return dict


class JsonList(JSON[list[Any]]):
    """A JSON list, and never another value."""

    @property
    def python_type(self) -> type[Any]:
        return list


def utc_now() -> datetime:
    """Return the wall-clock time, aware, in UTC."""
    return datetime.now(UTC)


Text20 = Annotated[str, 20]
Text40 = Annotated[str, 40]
Text80 = Annotated[str, 80]
Text200 = Annotated[str, 200]
Text300 = Annotated[str, 300]
"""Texts of at most so many characters; ids of resources have at most 40."""

Sha256 = Annotated[str, 64]
Long = Annotated[str, mapped_column(Text)]
Notes = Annotated[str, mapped_column(Text, default="")]
Large = Annotated[int, mapped_column(BigInteger)]


def fill_defaults(row: Any) -> None:
    """Give the members of a new row that nobody set their defaults, as writing it would."""
    for column in row.__mapper__.column_attrs:
        default = column.columns[0].default
        if default is not None and getattr(row, column.key) is None:
            setattr(row, column.key, default.arg(None) if default.is_callable else default.arg)


class Base(DeclarativeBase):
    metadata = MetaData(naming_convention=CONVENTION)
    type_annotation_map: ClassVar[dict[Any, Any]] = {
        dict[str, Any]: JsonObject(none_as_null=True),
        list[Any]: JsonList(none_as_null=True),
        datetime: Utc(),
        **{text: String(get_args(text)[1]) for text in (Text20, Text40, Sha256, Text80, Text200, Text300)},
        str: String(),
        int: Integer(),
        float: Float(),
        bool: Boolean(),
    }


def table_of(row: Base | type[Base]) -> Table:
    """Return the table of a row or of a class of rows."""
    return cast("Table", row.__table__)  # ours are tables all; SQLAlchemy knows views and joins too


class Row(Base):
    """What all resources have."""

    __abstract__ = True

    mission_key: ClassVar[str] = "mission_id"
    """The column with the mission that it belongs to, if it belongs to one."""

    id: Mapped[Text40] = mapped_column(primary_key=True)
    author: Mapped[Text80]
    created_utc: Mapped[datetime] = mapped_column(default=utc_now)
    modified_utc: Mapped[datetime] = mapped_column(default=utc_now)
    revision: Mapped[int] = mapped_column(default=1)


def mission_column(*, index: bool = True) -> Mapped[str]:
    """Return the column of the mission; without an index of its own where another begins with it."""
    return mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), index=index)
