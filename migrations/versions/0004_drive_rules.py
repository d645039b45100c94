"""The drives that a mission's people forbid or draw themselves."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give missions rules of drives."""
    op.add_column("missions", sa.Column("drive_rules", sa.JSON(), nullable=True))


def downgrade() -> None:
    """Take them away."""
    op.drop_column("missions", "drive_rules")
