"""Missions that are being copied."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0016"
down_revision = "0015"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Say of each mission whether it is still being copied; those that are there are not."""
    op.add_column("missions", sa.Column("in_making", sa.Boolean(), server_default=sa.false(), nullable=False))


def downgrade() -> None:
    """Take it away, and what was being copied with it: the missions and all that is theirs."""
    tables = sa.MetaData()
    tables.reflect(op.get_bind())
    missions = tables.tables["missions"]
    made = sa.select(missions.c.id).where(missions.c.in_making)
    for table in reversed(tables.sorted_tables):
        if "mission_id" in table.columns:
            op.execute(sa.delete(table).where(table.c.mission_id.in_(made)))
    op.execute(sa.delete(missions).where(missions.c.in_making))
    op.drop_column("missions", "in_making")
