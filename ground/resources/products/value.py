"""A data product and what asked for it."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any


@dataclass(frozen=True, slots=True)
class Product:
    """A data product with the way back to what asked for it; an orphan matches no request."""

    id: str
    mission_id: str
    run_id: str
    plan_id: str | None
    task_id: str
    request_id: str | None
    target_id: str | None
    kind: str
    instrument: str
    media: str
    file_name: str
    size_bytes: int
    sha256: str
    t_s: float
    label: dict[str, Any]
    orphan: bool
    file_url: str
    created_utc: datetime
