"""Who a person is at an OpenID Connect provider."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0014"
down_revision = "0013"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Give people the hash of issuer and subject."""
    with op.batch_alter_table("people") as table:
        table.add_column(sa.Column("external_sha256", sa.String(64), nullable=True))
        table.create_unique_constraint("uq_people_external_sha256", ["external_sha256"])


def downgrade() -> None:
    """Take it away."""
    with op.batch_alter_table("people") as table:
        table.drop_constraint("uq_people_external_sha256", type_="unique")
        table.drop_column("external_sha256")
