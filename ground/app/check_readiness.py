"""Say whether everything a request needs is there."""

from __future__ import annotations

import os

from sqlalchemy import inspect

from ground.gdr.repository import Repository


def check_readiness(repo: Repository) -> dict[str, str]:
    """Return `ok` or what is wrong for each part: database, schema, data folder."""
    repo.database.ping()
    tables = set(inspect(repo.database.engine).get_table_names())
    return {
        "database": "ok",
        "schema": "ok"
        if {"missions", "alembic_version"} <= tables
        else "not migrated: run `outcrop migrate`",
        "data_dir": "ok" if os.access(repo.data_dir, os.W_OK) else f"{repo.data_dir} cannot be written",
    }
