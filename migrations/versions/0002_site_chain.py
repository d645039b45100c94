"""The site chain: frames, solutions, frame files, maps of sites, traverses; what is tied to a frame."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None


def _row(name: str, *columns: sa.Column | sa.Constraint) -> None:
    op.create_table(
        name,
        sa.Column("mission_id", sa.String(length=40), nullable=False),
        *columns,
        sa.Column("id", sa.String(length=40), nullable=False),
        sa.Column("author", sa.String(length=80), nullable=False),
        sa.Column("created_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("modified_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=op.f(f"fk_{name}_mission_id"), ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=op.f(f"pk_{name}")),
    )
    op.create_index(op.f(f"ix_{name}_mission_id"), name, ["mission_id"], unique=False)


def upgrade() -> None:
    """Add frames, solutions, legs and maps of sites."""
    _row(
        "frames",
        sa.Column("key", sa.String(length=120), nullable=False),
        sa.Column("name", sa.String(length=80), nullable=False),
        sa.Column("counter", sa.JSON(), nullable=False),
        sa.Column("level", sa.String(length=10), nullable=False),
        sa.Column("site", sa.Integer(), nullable=False),
        sa.Column("drive", sa.Integer(), nullable=True),
        sa.Column("notes", sa.Text(), nullable=False),
        sa.Column("solution_id", sa.String(length=40), nullable=True),
        sa.Column("chosen_utc", sa.DateTime(timezone=True), nullable=True),
        sa.UniqueConstraint("mission_id", "key", name=op.f("uq_frames_mission_id_key")),
    )
    op.create_index("ix_frames_site", "frames", ["mission_id", "site"], unique=False)
    _row(
        "frame_files",
        sa.Column("file_name", sa.String(length=300), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.Column("rover", sa.String(length=80), nullable=False),
        sa.Column("variant", sa.String(length=80), nullable=False),
        sa.Column("counter", sa.JSON(), nullable=False),
        sa.Column("priority", sa.JSON(), nullable=False),
        sa.Column("aliases", sa.JSON(), nullable=False),
        sa.Column("added", sa.Integer(), nullable=False),
        sa.Column("known", sa.Integer(), nullable=False),
    )
    _row(
        "solutions",
        sa.Column("frame_id", sa.String(length=40), nullable=False),
        sa.Column("reference_id", sa.String(length=40), nullable=False),
        sa.Column("file_id", sa.String(length=40), nullable=True),
        sa.Column("label", sa.String(length=80), nullable=False),
        sa.Column("offset_m", sa.JSON(), nullable=False),
        sa.Column("quaternion", sa.JSON(), nullable=False),
        sa.Column("covariance", sa.JSON(), nullable=True),
        sa.Column("added_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("position", sa.BigInteger(), nullable=False),
        sa.Column("source", sa.JSON(), nullable=False),
        sa.Column("notes", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(
            ["frame_id"], ["frames.id"], name=op.f("fk_solutions_frame_id"), ondelete="CASCADE"
        ),
        sa.ForeignKeyConstraint(
            ["reference_id"], ["frames.id"], name=op.f("fk_solutions_reference_id"), ondelete="CASCADE"
        ),
    )
    op.create_index(op.f("ix_solutions_frame_id"), "solutions", ["frame_id"], unique=False)
    op.create_index(op.f("ix_solutions_reference_id"), "solutions", ["reference_id"], unique=False)
    op.create_index("ix_solutions_position", "solutions", ["mission_id", "position"], unique=False)
    _row(
        "site_maps",
        sa.Column("name", sa.String(length=80), nullable=False),
        sa.Column("notes", sa.Text(), nullable=False),
        sa.Column("frame_id", sa.String(length=40), nullable=False),
        sa.Column("in_frame", sa.JSON(), nullable=False),
        sa.Column("outline_m", sa.JSON(), nullable=False),
        sa.Column("sigma_m", sa.Float(), nullable=False),
        sa.Column("file_name", sa.String(length=300), nullable=False),
        sa.Column("media", sa.String(length=100), nullable=False),
        sa.Column("size_bytes", sa.BigInteger(), nullable=False),
        sa.Column("sha256", sa.String(length=64), nullable=False),
        sa.ForeignKeyConstraint(["frame_id"], ["frames.id"], name=op.f("fk_site_maps_frame_id")),
    )
    op.create_index(op.f("ix_site_maps_frame_id"), "site_maps", ["frame_id"], unique=False)
    _row(
        "traverses",
        sa.Column("name", sa.String(length=200), nullable=False),
        sa.Column("notes", sa.Text(), nullable=False),
        sa.Column("job_id", sa.String(length=40), nullable=False),
        sa.Column("stops", sa.JSON(), nullable=False),
        sa.Column("document", sa.JSON(), nullable=True),
        sa.Column("solution_ids", sa.JSON(), nullable=False),
    )
    op.add_column("missions", sa.Column("anchor_frame_id", sa.String(length=40), nullable=True))
    for name in ("targets", "keep_outs"):
        op.add_column(name, sa.Column("frame_id", sa.String(length=40), nullable=True))
        op.add_column(name, sa.Column("in_frame", sa.JSON(), nullable=True))
        op.create_index(op.f(f"ix_{name}_frame_id"), name, ["frame_id"], unique=False)
    op.add_column("keep_outs", sa.Column("sigma_m", sa.Float(), server_default="0", nullable=False))


def downgrade() -> None:
    """Drop them."""
    # one column at a time: a batch would make the table anew, and what refers to it would go with the old one
    op.drop_index(op.f("ix_keep_outs_frame_id"), "keep_outs")
    for column in ("sigma_m", "in_frame", "frame_id"):
        op.drop_column("keep_outs", column)
    op.drop_index(op.f("ix_targets_frame_id"), "targets")
    for column in ("in_frame", "frame_id"):
        op.drop_column("targets", column)
    op.drop_column("missions", "anchor_frame_id")
    for name in ("traverses", "site_maps", "solutions", "frame_files", "frames"):
        op.drop_table(name)
