"""Seals of rows in the history."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0012"
down_revision = "0011"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give events the digests of the rows that were written with them; older events have none."""
    known = {column["name"] for column in sa.inspect(op.get_bind()).get_columns("events")}
    if "rows" not in known:
        op.add_column("events", sa.Column("rows", sa.JSON(none_as_null=True), nullable=True))


def downgrade() -> None:
    """Leave them: the hashes of the events cover them, and nothing older looks at the column."""
