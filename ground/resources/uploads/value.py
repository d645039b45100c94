"""A file that was received and is not yet used."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True, slots=True)
class Upload:
    """A file received and not yet used."""

    id: str
    file_name: str
    size_bytes: int
    sha256: str
    author: str
    created_utc: datetime
