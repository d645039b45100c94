"""Alembic environment: the address comes from the caller, the schema from the versions beside this file."""

from __future__ import annotations

from alembic import context
from sqlalchemy import Connection

from ground.resources.tables import METADATA

config = context.config


def run(connection: Connection) -> None:
    """Run the migrations on a connection."""
    context.configure(
        connection=connection,
        target_metadata=METADATA,
        render_as_batch=connection.dialect.name == "sqlite",
        transaction_per_migration=False,
    )
    with context.begin_transaction():
        context.run_migrations()


run(config.attributes["connection"])
