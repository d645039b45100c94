"""Plans and campaigns that came in with an archive."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0010"
down_revision = "0009"
branch_labels = None
depends_on = None

TABLES = ("plans", "campaigns")


def upgrade() -> None:
    """Say of plans and campaigns whether they were made elsewhere.

    Those that came in before this revision cannot be told from others by their columns; the name of their
    author says it for campaigns, the document of the archive for plans.
    """
    for table in TABLES:
        op.add_column(table, sa.Column("elsewhere", sa.Boolean(), server_default=sa.false(), nullable=False))
    bind = op.get_bind()
    campaigns = sa.table("campaigns", sa.column("author", sa.String), sa.column("elsewhere", sa.Boolean))
    bind.execute(
        sa.update(campaigns).where(campaigns.c.author.like("% (elsewhere)")).values(elsewhere=sa.true())
    )
    plans = sa.table("plans", sa.column("id", sa.String), sa.column("elsewhere", sa.Boolean))
    documents = sa.table("elsewhere", sa.column("document", sa.JSON))
    for document in bind.scalars(sa.select(documents.c.document)).all():
        named = list(document.get("states", {}))
        bind.execute(sa.update(plans).where(plans.c.id.in_(named)).values(elsewhere=sa.true()))


def downgrade() -> None:
    """Say it no more."""
    for table in reversed(TABLES):
        op.drop_column(table, "elsewhere")
