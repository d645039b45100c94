"""Why an observation request is worth the rover's time."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0009"
down_revision = "0008"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give observation requests a rationale."""
    op.add_column(
        "observation_requests", sa.Column("rationale", sa.Text(), server_default="", nullable=False)
    )


def downgrade() -> None:
    """Take it away."""
    op.drop_column("observation_requests", "rationale")
