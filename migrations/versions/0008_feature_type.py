"""What a target lies on, in the words of the science team."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0008"
down_revision = "0007"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give targets a feature type."""
    op.add_column("targets", sa.Column("feature_type", sa.String(80), server_default="", nullable=False))


def downgrade() -> None:
    """Take it away."""
    op.drop_column("targets", "feature_type")
