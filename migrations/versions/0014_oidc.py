"""Who a person is at an OpenID Connect provider."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None


INDEX, OLD_CONSTRAINT = "ix_people_external_sha256", "uq_people_external_sha256"


def upgrade() -> None:
    """Give people the hash of issuer and subject."""
    # no batch: it would make the table anew, and sessions and keys that refer to it would go with the old one
    op.add_column("people", sa.Column("external_sha256", sa.String(64), nullable=True))
    op.create_index(INDEX, "people", ["external_sha256"], unique=True)


def downgrade() -> None:
    """Take it away; databases made by an earlier form of this revision have a constraint for an index."""
    constraints = sa.inspect(op.get_bind()).get_unique_constraints("people")
    if OLD_CONSTRAINT in {constraint["name"] for constraint in constraints}:
        with op.batch_alter_table("people") as table:
            table.drop_constraint(OLD_CONSTRAINT, type_="unique")
            table.drop_column("external_sha256")
    else:
        op.drop_index(INDEX, "people")
        op.drop_column("people", "external_sha256")
