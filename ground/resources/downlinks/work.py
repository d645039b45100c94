"""Take in a recording: its folder, whole or not at all, and its files in the store."""

from __future__ import annotations

import os
import secrets
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ground.day.prepare import Report
from ground.durable import DRAFT, make_folder, put_in_place, seal_folder
from ground.errors import ArchiveError, JobFailedError
from ground.gdr.files import FileStore, files_at
from ground.gdr.places import JOB_PATIENCE_S, fetched, keep_folder, open_store
from ground.jobs.queue import WorkStoppedError
from ground.resources.downlinks.order import RecordingWork
from ground.resources.downlinks.recording_folder import write_recording
from ground.resources.runs.work import RunResult, read_run_folder

if TYPE_CHECKING:
    from neighbours.robots.recording import Mapping, Recording

LOOK_S = 0.2
"""Between two looks at whether to stop; messages come by the thousand in that time."""
READ_SHARE = 0.9
"""Share of the work that is reading; what is left is the store."""


def work(order: RecordingWork, report: Report, should_stop: Callable[[], bool]) -> RunResult:
    """Return the run of a recording, as `read_run_folder` does; the folder is in its place.

    An attempt writes a draft of its own, so that two at once do not meet; what an attempt that died has put
    in place is taken as it is.

    Raises
    ------
    JobFailedError
        If the recording cannot be read, or the mapping does not fit it.
    """
    from neighbours.robots.errors import RobotFormatError
    from neighbours.robots.recording import mapping_of

    kept, files = open_store(order.run_dir, JOB_PATIENCE_S), files_at(order.files_dir)
    folder = kept.root
    looked = time.monotonic()

    def tell(share: float) -> None:
        nonlocal looked
        now = time.monotonic()
        if now - looked < LOOK_S and share < 1.0:
            return
        looked = now
        if should_stop():
            raise WorkStoppedError
        report(READ_SHARE * share, "messages" if share else "topics")

    report(0.0, "topics")
    try:
        if folder.exists():
            result = read_run_folder(folder, files)
        else:
            mapping = mapping_of(order.mapping, order.name)
            result, _ = keep_recording(folder, files, fetched(order.path), order.name, mapping, tell)
        keep_folder(kept)
        return result
    except (RobotFormatError, ArchiveError) as err:
        raise JobFailedError(f"{order.name}: {err}") from err
    except OSError as err:
        raise JobFailedError(f"{err.filename or order.name}: {err.strerror or err}") from err


def keep_recording(
    folder: Path, files: FileStore, source: Path, name: str, mapping: Mapping, tell: Callable[[float], None]
) -> tuple[RunResult, Recording]:
    """Write a recording's folder and put it in its place; return its run, and what was read."""
    make_folder(folder.parent)
    draft = folder.with_name(f"{DRAFT}{folder.name}-{os.getpid()}-{secrets.token_hex(4)}")
    try:
        recording = write_recording(draft, source, name, mapping, tell)
        result = read_run_folder(draft, files)
        seal_folder(draft)
        put_in_place(draft, folder)
    finally:
        shutil.rmtree(draft, ignore_errors=True)
    return result, recording
