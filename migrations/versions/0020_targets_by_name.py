"""Targets are found by their mission's names and by a frame where they have one: less to write for each."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0020"
down_revision = "0019"
branch_labels = None
depends_on = None

NAMED = sa.text("frame_id IS NOT NULL")


def upgrade() -> None:
    """Drop the index of the mission, which that of mission and name begins with, narrow that of frames."""
    op.drop_index("ix_targets_mission_id", "targets")
    op.drop_index("ix_targets_frame_id", "targets")
    op.create_index(
        "ix_targets_frame_id", "targets", ["frame_id"], sqlite_where=NAMED, postgresql_where=NAMED
    )


def downgrade() -> None:
    """Make them again as they were."""
    op.drop_index("ix_targets_frame_id", "targets")
    op.create_index("ix_targets_frame_id", "targets", ["frame_id"])
    op.create_index("ix_targets_mission_id", "targets", ["mission_id"])
