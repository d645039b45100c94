"""When the last backup, check of the history and check of the files were, kept in the data folder."""

from __future__ import annotations

import contextlib
import json
from datetime import UTC, datetime
from typing import Literal, get_args

from ground.durable import put_in_place
from ground.gdr.repository import Repository

Act = Literal["backup", "audit", "contents"]
ACTS: tuple[Act, ...] = get_args(Act)
FILE = "upkeep.json"


def note(repo: Repository, act: Act, faults: int = 0) -> None:
    """Write down that something was done now, and how many faults it found.

    A folder that takes no file leaves it undone: the backup or check itself has its result.
    """
    known = {**_read(repo), act: {"utc": datetime.now(UTC).isoformat(timespec="seconds"), "faults": faults}}
    draft = repo.data_dir / f".{FILE}"
    with contextlib.suppress(OSError):
        draft.write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")
        put_in_place(draft, repo.data_dir / FILE)


def noted(repo: Repository, act: Act) -> tuple[datetime, int] | None:
    """Return when something was last done and how many faults it found; None if it never was."""
    match _read(repo).get(act):
        case {"utc": str(when), "faults": int(faults)}:
            with contextlib.suppress(ValueError):
                return datetime.fromisoformat(when).astimezone(UTC), faults
    return None


def _read(repo: Repository) -> dict[str, object]:
    try:
        found = json.loads((repo.data_dir / FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}
