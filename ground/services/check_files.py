"""Compare the records with the files they name."""

from __future__ import annotations

import time
from dataclasses import dataclass

from sqlalchemy import select

from ground.gdr.models import PackageRow, ProductRow, RunRow, UploadRow
from ground.gdr.repository import Repository

FRESH_S = 3600.0
"""A file younger than this may belong to a request still being answered."""


@dataclass(frozen=True, slots=True)
class FileReport:
    """Products whose file is missing, files that no record names, number of files."""

    without_file: list[str]
    unnamed: list[str]
    files: int


def named_files(repo: Repository) -> set[str]:
    """Return the hashes that records name."""
    with repo.database.read() as session:
        named: set[str] = set()
        for column in (
            ProductRow.sha256,
            RunRow.trace_sha256,
            RunRow.telemetry_sha256,
            UploadRow.sha256,
            PackageRow.sha256,
        ):
            named |= {h for h in session.scalars(select(column)) if h is not None}
        return named


def check_files(repo: Repository) -> FileReport:
    """Return what does not fit together."""
    present = set(repo.files.hashes())
    with repo.database.read() as session:
        products = session.execute(select(ProductRow.id, ProductRow.sha256)).all()
    missing = [p.id for p in products if p.sha256 not in present]
    return FileReport(missing, sorted(present - named_files(repo)), len(present))


def sweep_files(repo: Repository) -> list[str]:
    """Remove files that no record names and that are older than an hour; return their hashes."""
    return repo.files.sweep(named_files(repo), time.time() - FRESH_S)
