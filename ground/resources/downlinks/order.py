"""What the job that takes in a recording is given."""

from __future__ import annotations

from typing import Any

from mission.codec import Codec
from mission.values import value


@value
class RecordingWork:
    """A recording at `path`, as it was called, and its mapping; it becomes the run of an id."""

    run_id: str
    path: str
    name: str
    mapping: dict[str, Any]
    run_dir: str
    files_dir: str


ORDERS = Codec(RecordingWork, "recording-order/1", "order for a recording")
