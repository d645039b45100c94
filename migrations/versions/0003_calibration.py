"""The calibration of the path network that a mission plans with."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give missions a calibration."""
    op.add_column("missions", sa.Column("calibration", sa.JSON(), nullable=True))


def downgrade() -> None:
    """Take it away."""
    op.drop_column("missions", "calibration")
