"""Constraints that an observation request carries beside its window, order and track."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0005"
down_revision = "0004"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give observation requests constraints."""
    op.add_column("observation_requests", sa.Column("constraints", sa.JSON(), nullable=True))


def downgrade() -> None:
    """Take them away."""
    op.drop_column("observation_requests", "constraints")
