"""Take in what a robot recorded while a plan was driven: a run that nothing here vouches for."""

from __future__ import annotations

import hashlib
import json
import math
import shutil
import tempfile
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from ground.errors import ArchiveError, GroundError, NotFoundError, StateError, UnavailableError
from ground.gdr.durable import copy_folder
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.value import JobState
from ground.records.actor import Action, Actor
from ground.records.edit import insert
from ground.records.get_resource import find_row
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.runs.bodies import RunImport
from ground.resources.runs.dry_run import record_run
from ground.resources.runs.kind import RUN
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import Run, RunKind
from ground.resources.runs.work import read_run_folder
from ground.resources.uploads.store_upload import find_upload

if TYPE_CHECKING:
    from neighbours.robots.recording import Mapping, Picture, RecordedPose, Recording

OUTCOME = "RECORDED"
ROVER = "recording"
MAX_NOTES = 4000
NANO = 1_000_000_000


@dataclass(frozen=True, slots=True)
class _Kept:
    """A picture whose file is written."""

    t_ns: int
    topic: str
    frame: str
    path: str
    sha256: str


def import_upload(repo: Repository, actor: Actor, given: RunImport) -> Run:
    """Take in an uploaded recording; see `import_recording`.

    Raises
    ------
    ArchiveError
        If it cannot be read, or the mapping does not fit it.
    UnavailableError
        If the extra `mcap` is not installed.
    """
    from neighbours.robots.errors import MissingExtraError, RecordingError
    from neighbours.robots.recording import Mapping

    actor.require_somewhere(Action.UPLINK)
    with repo.database.read() as session:
        upload = find_upload(session, actor, given.upload_id)
        name = upload.file_name
        source = repo.files.path(upload.sha256)
    wanted = given.mapping.model_dump()
    mapping = Mapping(**{**wanted, "pictures": tuple(wanted["pictures"])})
    try:
        return import_recording(repo, actor, given.plan_id, source, mapping, name=name)[0]
    except MissingExtraError as err:
        raise UnavailableError(str(err)) from err
    except RecordingError as err:
        raise ArchiveError(f"{name}: {err}", pointer="/upload_id") from err


def import_recording(
    repo: Repository, actor: Actor, plan_id: str, source: Path, mapping: Mapping, *, name: str = ""
) -> tuple[Run, Recording]:
    """Return the run made of a recording, and what was read.

    Poses and battery become its telemetry, pictures its products, each with the pose at its time. The run is
    marked as made elsewhere: it verifies nothing, calibrates nothing and settles no request.

    Raises
    ------
    NotFoundError, ForbiddenError
        If there is no such plan for the actor, or they may not take in runs of its mission.
    StateError
        If the plan is not computed.
    RobotFormatError
        If the recording cannot be read, or the mapping does not fit it.
    """
    from neighbours.robots.recording import read_recording

    with repo.database.read() as session:
        plan: PlanRow = find_row(session, PLAN, plan_id)
        if not actor.sees(plan.mission_id):
            raise NotFoundError(f"there is no {PLAN.title} {plan_id}")  # as if there were none
        actor.require(Action.UPLINK, plan.mission_id)
        if plan.crl_sha256 is None:
            raise StateError(f"plan {plan.number} is not computed; a recording is of a plan that was driven")
    run_id = new_id("run")
    kept = repo.run_dir(run_id)
    with tempfile.TemporaryDirectory(prefix="outcrop-recording-") as work:
        folder = Path(work) / "run"
        (folder / "products").mkdir(parents=True)
        pictures: list[_Kept] = []
        recording = read_recording(source, mapping, _keeper(folder, pictures))
        _write(folder, recording, pictures)
        result = read_run_folder(folder, repo.files.folder)
        copy_folder(folder, kept)
    try:
        with repo.database.write() as session:
            plan = find_row(session, PLAN, plan_id)
            row = RunRow(
                id=run_id,
                author=actor.name,
                mission_id=plan.mission_id,
                plan_id=plan.id,
                kind=RunKind.EXECUTION.value,
                rover=ROVER,
                seed=0,
                faults=[],
                job_id=None,
                state=JobState.RUNNING.value,
                options_taken=[],
                achieved_request_ids=[],
                crl_sha256=plan.crl_sha256 or "",
                notes=_notes(name or source.name, recording),
                elsewhere=True,
            )
            insert(session, actor, RUN, row)
            record_run(session, row, result)
            session.flush()
            return RUN.show_one(session, row), recording
    except GroundError:
        shutil.rmtree(kept, ignore_errors=True)
        raise


def _notes(name: str, recording: Recording) -> str:
    whole = "" if recording.whole else " The file is not whole."
    first = f"Recording {name}, made elsewhere: no executive of this installation vouches for it.{whole}"
    return "\n".join([first, *recording.findings])[:MAX_NOTES]


def _keeper(folder: Path, pictures: list[_Kept]) -> Callable[[Picture], None]:
    """Return what writes each picture into the folder as it comes."""

    def keep(picture: Picture) -> None:
        path = f"products/{len(pictures):06d}.{picture.format}"
        (folder / path).write_bytes(picture.data)
        sha256 = hashlib.sha256(picture.data).hexdigest()
        pictures.append(_Kept(picture.t_ns, picture.topic[:200], picture.frame[:200], path, sha256))

    return keep


LAST_S = 4_000_000_000
"""Seconds since 1970 in the year 2096; stamps of ROS 2 end in 2106."""


def _write(folder: Path, recording: Recording, pictures: list[_Kept]) -> None:
    """Write the folder `run/1` of a recording; its time 0 is its first pose, level or picture."""
    stamps = [
        *(p.t_ns for p in recording.poses),
        *(t for t, _ in recording.battery),
        *(p.t_ns for p in pictures),
    ]
    zero_ns, end_ns = min(stamps), max(stamps)
    for stamp in (zero_ns, end_ns):
        if not 0 <= stamp < LAST_S * NANO:
            raise ArchiveError(f"a time stamp of {stamp / NANO:g} s; 0 to {LAST_S} since 1970 are taken")
    document = {
        "format": "run/1",
        "outcome": OUTCOME,
        "end_s": (end_ns - zero_ns) / NANO,
        "rover": ROVER,
        "start_utc": datetime.fromtimestamp(zero_ns / NANO, UTC).isoformat(),
        "topics": dict(recording.messages),
        "findings": recording.findings,
    }
    (folder / "run.json").write_text(json.dumps(document, indent=1), encoding="utf-8")
    (folder / "trace.jsonl").write_text("", encoding="utf-8")
    with (folder / "telemetry.jsonl").open("w", encoding="utf-8") as file:
        file.writelines(json.dumps(sample) + "\n" for sample in _samples(recording, zero_ns))
    with (folder / "products.jsonl").open("w", encoding="utf-8") as file:
        for one in sorted(pictures, key=lambda p: p.t_ns):
            label = {"topic": one.topic, "frame": one.frame, **_pose_label(recording.poses, one.t_ns)}
            line = {
                "t_s": (one.t_ns - zero_ns) / NANO,
                "task": "",
                "kind": "image",
                "path": one.path,
                "sha256": one.sha256,
                "label": label,
            }
            file.write(json.dumps(line) + "\n")


def _samples(recording: Recording, zero_ns: int) -> Iterator[dict[str, object]]:
    """Yield a sample for each pose, with the last battery level; NaN is what was not told."""
    levels = recording.battery
    times = [t for t, _ in levels]
    for pose in recording.poses:
        place = bisect_right(times, pose.t_ns)
        level = levels[place - 1][1] if place else math.nan
        yield {
            "t_s": (pose.t_ns - zero_ns) / NANO,
            "east_m": round(pose.east_m, 6),
            "north_m": round(pose.north_m, 6),
            "heading_rad": round(pose.heading_rad, 7),
            "battery_j": level,
            "energy_used_j": levels[0][1] - level if place else math.nan,
            "task": "",
            "trackers": {},
        }


def _pose_label(poses: list[RecordedPose], t_ns: int) -> dict[str, float]:
    """Return the pose at a time, between two recorded ones on the straight line; nothing outside them."""
    place = bisect_right(poses, t_ns, key=lambda pose: pose.t_ns)
    if not poses or place == 0 or (place == len(poses) and poses[-1].t_ns != t_ns):
        return {}
    before, after = poses[place - 1], poses[min(place, len(poses) - 1)]
    span = after.t_ns - before.t_ns
    share = (t_ns - before.t_ns) / span if span else 0.0
    turn = math.remainder(after.heading_rad - before.heading_rad, 2 * math.pi)
    return {
        "east_m": before.east_m + share * (after.east_m - before.east_m),
        "north_m": before.north_m + share * (after.north_m - before.north_m),
        "heading_rad": before.heading_rad + share * turn,
    }
