"""The repository as one value: database, files, folders."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from ground.durable import FOLDER_MODE, make_folder
from ground.gdr.database import Database
from ground.gdr.files import FileStore
from ground.gdr.places import brought_folder, store_at
from ground.gdr.store import Store
from ground.settings import Settings

Folders = Literal["terrains", "runs", "campaigns"]
FOLDERS_KEPT: tuple[Folders, ...] = ("terrains", "runs", "campaigns")
"""Kinds of folders that are kept whole."""


@dataclass(frozen=True, slots=True)
class Repository:
    """Everything a service needs; made once for a process."""

    settings: Settings
    database: Database
    files: FileStore

    @property
    def data_dir(self) -> Path:
        return self.settings.data_dir

    def folders(self, kind: Folders) -> Store:
        """Return the store of the folders of a kind, each by the id of its row."""
        return store_at(self.settings.objects, self.data_dir, kind)

    def terrain_dir(self, terrain_id: str) -> Path:
        """Return the folder, in the form `terrain/1`, of a terrain; it is brought if need be."""
        return brought_folder(self.folders("terrains").at(terrain_id))

    def run_dir(self, run_id: str) -> Path:
        """Return the folder in which a run writes journal, telemetry and products while it goes on.

        Of a run that is over it is brought if need be.
        """
        return brought_folder(self.folders("runs").at(run_id))

    def campaign_dir(self, campaign_id: str) -> Path:
        """Return the folder of a campaign's runs; of one that is over it is brought if need be."""
        return brought_folder(self.folders("campaigns").at(campaign_id))

    def address(self, kind: Folders, identifier: str) -> str:
        """Return what an order of a job calls a folder."""
        return self.folders(kind).at(identifier).address

    def training_dir(self, mission_id: str) -> Path:
        """Return the folder of a mission's training rover: its ledger, trust file and runs."""
        return self.data_dir / "training" / mission_id

    def job_dir(self) -> Path:
        """Return the folder in which jobs leave word of their progress."""
        return self.data_dir / "jobs"


def open_repository(settings: Settings) -> Repository:
    """Return the repository of these settings; the database is not migrated.

    The data folder is its owner's alone: it holds what a person of the same machine may not read.
    """
    make_folder(settings.data_dir)
    with contextlib.suppress(PermissionError):  # of another owner, who answers for it
        settings.data_dir.chmod(FOLDER_MODE)
    files = FileStore(store_at(settings.objects, settings.data_dir, "files"))
    return Repository(settings, Database(settings.database_address), files)
