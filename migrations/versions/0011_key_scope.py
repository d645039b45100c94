"""What an API key is for: a role at most, and single missions."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0011"
down_revision = "0010"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give credentials a scope."""
    op.add_column("credentials", sa.Column("role", sa.String(20), nullable=True))
    op.add_column("credentials", sa.Column("mission_ids", sa.JSON(none_as_null=True), nullable=True))


def downgrade() -> None:
    """Take it away; keys that were narrowed go with it, for they would come to more than was given."""
    op.execute("DELETE FROM credentials WHERE role IS NOT NULL OR mission_ids IS NOT NULL")
    op.drop_column("credentials", "mission_ids")
    op.drop_column("credentials", "role")
