"""Comments may be on a part of their subject: a step of a plan."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0022"
down_revision = "0021"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the column."""
    op.add_column("comments", sa.Column("part", sa.String(200), nullable=True))


def downgrade() -> None:
    """Take it away."""
    op.drop_column("comments", "part")
