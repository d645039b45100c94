"""Adjust stops of recorded runs together: a job, whose solutions wait for somebody to choose them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import cast

from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NotFoundError
from ground.gdr.ids import new_id
from ground.gdr.places import inside_of
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import Job
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, new_row, update
from ground.records.get_resource import find_row, read_row, require_mission, row_in_mission
from ground.resources.ask_job import ask_job
from ground.resources.frames.kind import FRAME
from ground.resources.frames.site_chain import load_chain, require_frame
from ground.resources.runs.kind import RUN
from ground.resources.solutions.choose_solution import GivenSolution, insert_solution
from ground.resources.traverses.bodies import StopBody, TraverseCreate
from ground.resources.traverses.kind import TRAVERSE
from ground.resources.traverses.order import ORDERS, Accuracy, SeenStop, TraverseWork
from ground.resources.traverses.row import TraverseRow
from ground.resources.traverses.work import AdjustedPose
from ground.resources.uploads.store_upload import find_upload

KIND = "adjust_traverse"
LABEL = "adjusted"


def adjust_traverse(repo: Repository, actor: Actor, mission_id: str, given: TraverseCreate) -> Job:
    """Return the job whose subject is the new traverse.

    Raises
    ------
    InvalidInputError
        If a frame, run, panorama or upload is not there, or a frame comes twice.
    StateError
        If nothing ties a frame to the anchor.
    """
    actor.require(Action.PLAN, mission_id)
    with repo.database.write() as session:
        require_mission(session, mission_id)
        chain = load_chain(session, mission_id)
        listed: list[dict[str, object]] = []
        seen: list[SeenStop] = []
        for index, stop in enumerate(given.stops):
            frame = require_frame(session, mission_id, stop.frame_id, f"/stops/{index}/frame_id")
            if any(frame.id == other["frame_id"] for other in listed):
                raise InvalidInputError(f"{frame.key} comes twice", pointer=f"/stops/{index}/frame_id")
            place = chain.place(frame.id)
            path, file_name = _source(repo, session, actor, mission_id, stop, f"/stops/{index}")
            listed.append({**stop.model_dump(), "name": frame.key})
            most = int(repo.settings.max_body_mib * 8 * 2**20)
            seen.append(SeenStop(frame.key, str(path), file_name, place.east_m, place.north_m, most))
        job_id = new_id("job")
        row = new_row(
            TRAVERSE, actor, mission_id, given, job_id=job_id, stops=listed, document=None, solution_ids=[]
        )
        insert(session, actor, TRAVERSE, row)
        accuracy = Accuracy(given.odometry, given.heading_rad, given.sun_rad, given.longest_m)
        work = TraverseWork(tuple(seen), str(repo.files.folder), accuracy)
        return ask_job(
            session, repo, actor, KIND, mission_id, (TRAVERSE, row.id), ORDERS.document(work), job_id
        )


def _source(
    repo: Repository, session: Session, actor: Actor, mission_id: str, stop: StopBody, pointer: str
) -> tuple[str, str]:
    """Return the address of what was seen from a stop, and its name."""
    if stop.upload_id is not None:
        try:
            upload = find_upload(session, actor, stop.upload_id)
        except NotFoundError as err:
            raise InvalidInputError(err.message, pointer=f"{pointer}/upload_id") from err
        return repo.files.address_of(upload.sha256), upload.file_name
    run = row_in_mission(session, RUN, stop.run_id, mission_id, f"{pointer}/run_id")
    folder = repo.run_dir(run.id)
    address = repo.address("runs", run.id)
    inside = (path.parent.relative_to(folder) for path in sorted(folder.rglob("panorama.json")))
    known = {place.as_posix(): inside_of(address, place) for place in inside}
    if stop.panorama in known:
        return known[stop.panorama], stop.panorama
    if not stop.panorama and len(known) == 1:
        return next(iter(known.items()))[::-1]
    has = ", ".join(known) or "none"
    raise InvalidInputError(
        f"run {run.id} has no panorama {stop.panorama!r}; it has {has}", pointer=f"{pointer}/panorama"
    )


def settle(_repo: Repository, session: Session, job: JobRow, result: Mapping[str, object]) -> str | None:
    """Write the document, and a solution for each stop but the first, which is held.

    Each new solution lies in the frame of the first stop, with the covariance of the adjustment. None is in
    use before somebody chooses it.
    """
    row = session.get(TraverseRow, job.subject_id)
    if row is None:
        return None
    made = []
    poses = cast("Sequence[AdjustedPose]", result["poses"])
    for stop, given in zip(row.stops[1:], _solutions(session, row, poses), strict=True):
        frame = find_row(session, FRAME, stop["frame_id"])
        source = {"kind": "traverse", "traverse_id": row.id, "job_id": job.id, "by": row.author}
        made.append(insert_solution(session, SYSTEM_ACTOR, frame, given, source).id)
    columns = {"document": result["document"], "solution_ids": made}
    update(session, SYSTEM_ACTOR, TRAVERSE, row, columns, action="compute")
    return f"/api/v1/traverses/{row.id}"


def _solutions(session: Session, row: TraverseRow, poses: Sequence[AdjustedPose]) -> list[GivenSolution]:
    import numpy as np

    from rover_iface.frames import NED_FROM_ENU, Transform, quaternion_of
    from rover_iface.localization.bundle_adjustment import adjoint

    chain = load_chain(session, row.mission_id)
    enu_from_ned = Transform(np.array(NED_FROM_ENU), np.zeros(3))  # its own inverse
    held = chain.placed(row.stops[0]["frame_id"]).anchor_from_frame
    first = Transform(np.array(poses[0]["rotation"]), np.array(poses[0]["translation"]))
    first_believed = Transform(np.eye(3), np.array(poses[0]["believed_m"]))
    given = []
    for stop, pose in zip(row.stops[1:], poses[1:], strict=True):
        frame = chain.placed(stop["frame_id"]).anchor_from_frame
        believed = Transform(np.eye(3), np.array(pose["believed_m"]))
        adjusted = Transform(np.array(pose["rotation"]), np.array(pose["translation"]))
        # all east-north-up: where the eye was believed and is, and the frame as it hangs on the eye
        eye_from_frame = believed.inverse() * enu_from_ned * frame
        first_from_held = first_believed.inverse() * enu_from_ned * held
        moved = (first * first_from_held).inverse() * adjusted * eye_from_frame
        back = adjoint(eye_from_frame.inverse())
        spread = back @ np.array(pose["covariance"]) @ back.T
        given.append(
            GivenSolution(
                label=LABEL,
                reference_id=row.stops[0]["frame_id"],
                offset_m=[float(x) for x in moved.translation],
                quaternion=list(quaternion_of(moved.rotation)),
                covariance=(0.5 * (spread + spread.T)).tolist(),
                notes=f"traverse {row.name}"[:2000],
            )
        )
    return given


def read_picture(repo: Repository, actor: Actor, traverse_id: str, index: int) -> Path:
    """Return the picture of a stop of a traverse.

    Raises
    ------
    NotFoundError
        If the traverse has no such stop, or is not computed.
    """
    row: TraverseRow = read_row(repo, actor, TRAVERSE, traverse_id)
    stops = [] if row.document is None else row.document["stops"]
    if index >= len(stops):
        raise NotFoundError(f"traverse {traverse_id} has {len(stops)} pictures, none with number {index}")
    return repo.files.path(stops[index]["picture"]["sha256"])
