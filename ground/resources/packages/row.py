"""Tables of what people sign of a plan, their signatures, and uplink packages."""

from __future__ import annotations

from sqlalchemy import (
    BigInteger,
    ForeignKey,
    String,
    Text,
    UniqueConstraint,
)
from sqlalchemy.orm import Mapped, mapped_column

from ground.gdr.base import Base, Row, mission_column


class CounterRow(Base):
    """The last counter that a mission gave to a statement; a rover carries out none that is not higher."""

    __tablename__ = "counters"

    mission_id: Mapped[str] = mapped_column(ForeignKey("missions.id", ondelete="CASCADE"), primary_key=True)
    last: Mapped[int] = mapped_column(BigInteger)


class StatementRow(Row):
    """The manifest of a package to be: what author, verifier and approver sign, with the files it binds."""

    __tablename__ = "statements"
    __table_args__ = (UniqueConstraint("mission_id", "counter"),)

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    counter: Mapped[int] = mapped_column(BigInteger)
    sha256: Mapped[str] = mapped_column(String(64))
    manifest: Mapped[str] = mapped_column(Text)
    landmarks: Mapped[str] = mapped_column(Text)


class SignatureRow(Row):
    """What a person, the row's author, signed a statement as."""

    __tablename__ = "signatures"
    __table_args__ = (UniqueConstraint("statement_id", "role", "key_id"),)

    mission_id: Mapped[str] = mission_column()
    statement_id: Mapped[str] = mapped_column(ForeignKey("statements.id", ondelete="CASCADE"), index=True)
    role: Mapped[str] = mapped_column(String(20))
    key_id: Mapped[str] = mapped_column(String(16))
    signature: Mapped[str] = mapped_column(String(88))


class PackageRow(Row):
    """An uplink package that was made; sequence numbers, its statement's counter, ascend in each mission."""

    __tablename__ = "packages"
    __table_args__ = (UniqueConstraint("mission_id", "sequence"),)

    mission_id: Mapped[str] = mission_column()
    plan_id: Mapped[str] = mapped_column(ForeignKey("plans.id", ondelete="CASCADE"), index=True)
    sequence: Mapped[int]
    sha256: Mapped[str] = mapped_column(String(64))
    key_id: Mapped[str] = mapped_column(String(64))
