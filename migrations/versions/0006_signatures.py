"""What people sign of a plan, their public keys, and runs that were made elsewhere."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0006"
down_revision = "0005"
branch_labels = None
depends_on = None


def _resource(name: str, *columns: sa.Column[object] | sa.schema.SchemaItem) -> None:
    op.create_table(
        name,
        sa.Column("id", sa.String(40), nullable=False),
        sa.Column("author", sa.String(80), nullable=False),
        sa.Column("created_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("modified_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("revision", sa.Integer(), nullable=False),
        sa.Column("mission_id", sa.String(40), nullable=False),
        *columns,
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name=f"fk_{name}_mission_id", ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name=f"pk_{name}"),
    )
    op.create_index(f"ix_{name}_mission_id", name, ["mission_id"])


def upgrade() -> None:
    """Add the tables."""
    op.add_column("runs", sa.Column("elsewhere", sa.Boolean(), server_default=sa.false(), nullable=False))
    op.create_table(
        "counters",
        sa.Column("mission_id", sa.String(40), nullable=False),
        sa.Column("last", sa.BigInteger(), nullable=False),
        sa.ForeignKeyConstraint(
            ["mission_id"], ["missions.id"], name="fk_counters_mission_id", ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("mission_id", name="pk_counters"),
    )
    _resource(
        "statements",
        sa.Column("plan_id", sa.String(40), nullable=False),
        sa.Column("counter", sa.BigInteger(), nullable=False),
        sa.Column("sha256", sa.String(64), nullable=False),
        sa.Column("manifest", sa.Text(), nullable=False),
        sa.Column("landmarks", sa.Text(), nullable=False),
        sa.ForeignKeyConstraint(["plan_id"], ["plans.id"], name="fk_statements_plan_id", ondelete="CASCADE"),
        sa.UniqueConstraint("mission_id", "counter", name="uq_statements_mission_id_counter"),
    )
    op.create_index("ix_statements_plan_id", "statements", ["plan_id"])
    _resource(
        "signatures",
        sa.Column("statement_id", sa.String(40), nullable=False),
        sa.Column("role", sa.String(20), nullable=False),
        sa.Column("key_id", sa.String(16), nullable=False),
        sa.Column("signature", sa.String(88), nullable=False),
        sa.ForeignKeyConstraint(
            ["statement_id"], ["statements.id"], name="fk_signatures_statement_id", ondelete="CASCADE"
        ),
        sa.UniqueConstraint("statement_id", "role", "key_id", name="uq_signatures_statement_id_role_key_id"),
    )
    op.create_index("ix_signatures_statement_id", "signatures", ["statement_id"])
    op.create_table(
        "signing_keys",
        sa.Column("id", sa.String(16), nullable=False),
        sa.Column("person_id", sa.String(40), nullable=False),
        sa.Column("name", sa.String(80), nullable=False),
        sa.Column("public", sa.String(44), nullable=False),
        sa.Column("created_utc", sa.DateTime(timezone=True), nullable=False),
        sa.Column("revoked_utc", sa.DateTime(timezone=True), nullable=True),
        sa.ForeignKeyConstraint(
            ["person_id"], ["people.id"], name="fk_signing_keys_person_id", ondelete="CASCADE"
        ),
        sa.PrimaryKeyConstraint("id", name="pk_signing_keys"),
    )
    op.create_index("ix_signing_keys_person_id", "signing_keys", ["person_id"])

    _resource("elsewhere", sa.Column("document", sa.JSON(), nullable=False))


def downgrade() -> None:
    """Drop them."""
    for name in ("elsewhere", "signing_keys", "signatures", "statements", "counters"):
        op.drop_table(name)
    op.drop_column("runs", "elsewhere")
