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
    """Take it away, and what was being copied with it."""
    op.execute("DELETE FROM missions WHERE in_making")
    op.drop_column("missions", "in_making")
