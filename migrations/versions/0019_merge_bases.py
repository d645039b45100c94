"""Merge bases: what a mission took over from another, by a copy or a merge."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0019"
down_revision = "0018"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Add the table."""
    op.create_table(
        "merge_bases",
        sa.Column("id", sa.String(40), nullable=False),
        sa.Column("author", sa.String(80), nullable=False),
        sa.Column("created_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("modified_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("mission_id", sa.String(40), nullable=False),
        sa.Column("from_id", sa.String(40), nullable=False),
        sa.Column("event", sa.BigInteger(), nullable=False),
        sa.Column("pairs", sa.JSON(none_as_null=True), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name="fk_merge_bases_mission_id", ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_merge_bases"),
    )
    op.create_index("ix_merge_bases_mission_id", "merge_bases", ["mission_id"])
    op.create_index("ix_merge_bases_from_id", "merge_bases", ["from_id"])


def downgrade() -> None:
    """Drop it."""
    op.drop_table("merge_bases")
