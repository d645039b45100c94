"""The repository as one value: database, files, folders."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path

from ground.durable import FOLDER_MODE, make_folder
from ground.gdr.database import Database
from ground.gdr.files import FileStore
from ground.settings import Settings


@dataclass(frozen=True, slots=True)
class Repository:
    """Everything a service needs; made once for a process."""

    settings: Settings
    database: Database
    files: FileStore

    @property
    def data_dir(self) -> Path:
        return self.settings.data_dir

    def terrain_dir(self, terrain_id: str) -> Path:
        """Return the folder, in the form `terrain/1`, of a terrain."""
        return self.data_dir / "terrains" / terrain_id

    def run_dir(self, run_id: str) -> Path:
        """Return the folder in which a run writes journal, telemetry and products while it goes on."""
        return self.data_dir / "runs" / run_id

    def campaign_dir(self, campaign_id: str) -> Path:
        """Return the folder of a campaign's runs."""
        return self.data_dir / "campaigns" / campaign_id

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
    return Repository(settings, Database(settings.database_address), FileStore(settings.data_dir / "files"))
