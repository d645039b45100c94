"""Where a mission's site lies on its body."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0015"
down_revision = "0014"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give missions a place; those that are there have none."""
    op.add_column("missions", sa.Column("place", sa.JSON(), nullable=True))


def downgrade() -> None:
    """Take it away."""
    op.drop_column("missions", "place")
