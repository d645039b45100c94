"""Add a solution to a frame, and choose which one is in use: what is tied to the frame is carried along."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, StateError
from ground.gdr.base import utc_now
from ground.gdr.history import ChainRow
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, open_for_change, update
from ground.records.get_resource import find_row
from ground.records.kind import Kind
from ground.resources.frames.create_frame import next_position
from ground.resources.frames.kind import FRAME
from ground.resources.frames.row import FrameRow, SolutionRow
from ground.resources.frames.site_chain import Chain, load_chain, outline_of, require_frame
from ground.resources.frames.value import FramePlace
from ground.resources.keep_outs.kind import KEEP_OUT
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.observation_requests.change_request import set_by_hand
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.place_rover import place_rover
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.site_maps.kind import SITE_MAP
from ground.resources.site_maps.row import SiteMapRow
from ground.resources.solutions.kind import SOLUTION
from ground.resources.solutions.value import Carried, Moved, Solution
from ground.resources.targets.kind import TARGET
from ground.resources.targets.row import TargetRow
from ground.resources.targets.tie_target import target_columns_of

STILL_M = 1e-6
"""A thing that a choice moves by less, in place and in deviation, is left alone."""


@dataclass(frozen=True, slots=True)
class GivenSolution:
    """Where a person or a job says that a frame lies; members as in `Solution`."""

    label: str
    reference_id: str
    offset_m: Sequence[float]
    quaternion: Sequence[float]
    covariance: Sequence[Sequence[float]] | None = None
    notes: str = ""


def add_solution(repo: Repository, actor: Actor, frame_id: str, given: GivenSolution) -> Solution:
    """Return a new solution of a frame; it is not in use until it is chosen.

    Raises
    ------
    InvalidInputError
        If a value cannot be one, or the reference is not a frame of the mission.
    """
    with repo.database.write() as session:
        frame = find_row(session, FRAME, frame_id)
        actor.require(Action.EDIT_MISSION, frame.mission_id)
        row = insert_solution(session, actor, frame, given, {"kind": "by_hand"})
        return SOLUTION.show_one(session, row)


def insert_solution(
    session: Session,
    actor: Actor,
    frame: FrameRow,
    given: GivenSolution,
    source: Mapping[str, object],
) -> SolutionRow:
    """Write a new solution behind all others."""
    from rover_iface.errors import RoverError
    from rover_iface.frames import Transform
    from rover_iface.localization.anchored_chain import Link
    from rover_iface.localization.site_frames import FrameId, FrameSolution

    reference = require_frame(session, frame.mission_id, given.reference_id, "/reference_id")
    if reference.id == frame.id:
        raise InvalidInputError(f"{frame.key} cannot lie in itself", pointer="/reference_id")
    added = utc_now().replace(microsecond=0)
    x, y, z = given.offset_m
    s, v1, v2, v3 = given.quaternion
    try:
        FrameSolution(
            given.label,
            FrameId(frame.name, tuple(frame.counter)),
            FrameId(reference.name, tuple(reference.counter)),
            (x, y, z),
            (s, v1, v2, v3),
            added,
        )
    except RoverError as err:
        raise InvalidInputError(str(err), pointer="/quaternion") from err
    try:
        Link(
            FrameId(reference.name, tuple(reference.counter)), Transform.identity(), _array(given.covariance)
        )
    except RoverError as err:
        raise InvalidInputError(str(err), pointer="/covariance") from err
    row = SolutionRow(
        id=new_id("sln"),
        author=actor.name,
        mission_id=frame.mission_id,
        frame_id=frame.id,
        reference_id=reference.id,
        file_id=None,
        label=given.label,
        offset_m=[x, y, z],
        quaternion=[s, v1, v2, v3],
        covariance=None if given.covariance is None else [list(line) for line in given.covariance],
        added_utc=added,
        position=next_position(session, frame.mission_id),
        source=dict(source),
        notes=given.notes,
    )
    insert(session, actor, SOLUTION, row)
    return row


def _array(covariance: Sequence[Sequence[float]] | None) -> Any:
    import numpy as np

    return None if covariance is None else np.array(covariance, dtype=float)


@dataclass(frozen=True)
class _Move:
    """What becomes of one row; `points` are the observation points of a moved target's requests."""

    kind: Kind[Any]
    row_id: str
    columns: Mapping[str, Any]
    moved: Moved
    points: Mapping[str, Mapping[str, Any]]


def choose_solution(
    repo: Repository,
    actor: Actor,
    frame_id: str,
    solution_id: str | None,
    revision: int | None,
    *,
    preview: bool = False,
    reason: str = "",
) -> Carried:
    """Put a solution of a frame in use (None: none), and carry along all that is tied to frames it moves.

    Targets move rigidly, with covariance and the observation points of their requests; keep-outs and maps
    with their outlines. All of it is one act: undo takes it back, and so does choosing the solution before.
    With `preview` nothing is written.

    Raises
    ------
    InvalidInputError
        If the solution is not one of this frame.
    StateError
        If frames would refer to each other in a circle, or something tied would hang nowhere.
    StaleRevisionError
        If somebody else changed the frame in between.
    """
    while True:
        with repo.database.read() as session:
            frame = find_row(session, FRAME, frame_id)
            actor.require(Action.READ if preview else Action.EDIT_MISSION, frame.mission_id)
            _require_own(session, frame, solution_id)
            head = _head(session, frame.mission_id)
            moves = _moves(repo, session, frame, solution_id)
            if preview:
                shown = FRAME.show_one(session, frame)
                after = _chain_with(session, frame, solution_id)
                shown = replace(shown, solution_id=solution_id, place=_place(after, frame.id))
                return Carried(shown, True, [move.moved for move in moves], frame.revision)
        with repo.database.write() as session:
            row = open_for_change(session, actor, FRAME, frame_id, revision)
            if _head(session, row.mission_id, lock=True) != head:
                continue  # somebody was faster: what was worked out is of another state
            columns = {"solution_id": solution_id, "chosen_utc": utc_now()}
            if row.solution_id != solution_id:
                update(session, actor, FRAME, row, columns, action="choose", reason=reason)
            for move in moves:
                _carry(session, actor, move, f"{row.key} re-localised")
            return Carried(FRAME.show_one(session, row), False, [move.moved for move in moves], row.revision)


def _head(session: Session, mission_id: str, *, lock: bool = False) -> int:
    """Return the number of the newest event; locked, it stays that until the end of the transaction."""
    query = select(ChainRow.seq).where(ChainRow.id == mission_id)
    return int(session.scalar(query.with_for_update() if lock else query) or 0)


def _require_own(session: Session, frame: FrameRow, solution_id: str | None) -> None:
    solution = None if solution_id is None else session.get(SolutionRow, solution_id)
    if solution_id is not None and (solution is None or solution.frame_id != frame.id):
        raise InvalidInputError(f"{frame.key} has no solution {solution_id}", pointer="/solution_id")


def _chain_with(session: Session, frame: FrameRow, solution_id: str | None) -> Chain:
    if solution_id is not None:
        return load_chain(session, frame.mission_id, {frame.id: solution_id})
    before = frame.solution_id
    return load_chain(session, frame.mission_id, {} if before is None else {frame.id: ""})


def _place(chain: Chain, frame_id: str) -> FramePlace | None:
    try:
        return chain.place(frame_id)
    except StateError:
        return None


def _moves(repo: Repository, session: Session, frame: FrameRow, solution_id: str | None) -> list[_Move]:
    """Return what the choice moves, with everything worked out that the terrain has to say to it."""
    after = _chain_with(session, frame, solution_id)
    if after.placements is not None:
        for other in after.names:
            _place(after, other)  # a circle anywhere is found now, and not by who looks at the frame next
    moves = []
    for target in session.scalars(_tied(TargetRow, frame.mission_id)):
        columns = target_columns_of(after.placed(target.frame_id), target.in_frame)
        before = (target.east_m, target.north_m, target.up_m)
        moved = _moved(
            TARGET,
            target,
            math.dist(before, (columns["east_m"], columns["north_m"], columns["up_m"])),
            _sigma(target.covariance_m2),
            _sigma(columns["covariance_m2"]),
        )
        if moved is not None:
            points = _points(repo, session, target, columns)
            moves.append(_Move(TARGET, target.id, columns, moved, points))
    for kind, row_type, name in (
        (KEEP_OUT, KeepOutRow, "polygon_m"),
        (SITE_MAP, SiteMapRow, "outline_m"),
    ):
        for row in session.scalars(_tied(row_type, frame.mission_id)):
            outline, sigma = outline_of(after.placed(row.frame_id), row.in_frame)
            shift = max(math.dist(a, b) for a, b in zip(outline, getattr(row, name), strict=True))
            moved = _moved(kind, row, shift, row.sigma_m, sigma)
            if moved is not None:
                moves.append(_Move(kind, row.id, {name: outline, "sigma_m": sigma}, moved, {}))
    return moves


def _tied(row: Any, mission_id: str) -> Any:
    return select(row).where(row.mission_id == mission_id, row.frame_id.is_not(None)).order_by(row.id)


def _moved(kind: Kind[Any], row: Any, shift_m: float, before_m: float, after_m: float) -> Moved | None:
    if shift_m < STILL_M and abs(after_m - before_m) < STILL_M:
        return None
    return Moved(kind.name, row.id, row.name, shift_m, before_m, after_m)


def _sigma(covariance: Sequence[Sequence[float]]) -> float:
    """Return the deviation in the worst direction."""
    import numpy as np

    return math.sqrt(max(0.0, float(np.linalg.eigvalsh(np.array(covariance, dtype=float))[-1])))


def _points(
    repo: Repository, session: Session, target: TargetRow, columns: Mapping[str, Any]
) -> dict[str, Mapping[str, Any]]:
    moved = TargetRow(id=target.id, mission_id=target.mission_id, name=target.name, **columns)
    requests = ObservationRequestRow
    return {
        request.id: asdict(place_rover(repo, session, moved, request.instrument))
        for request in session.scalars(select(requests).where(requests.target_id == target.id))
        if not set_by_hand(request)
    }


def _carry(session: Session, actor: Actor, move: _Move, why: str) -> None:
    kind = move.kind
    row = session.get_one(kind.row, move.row_id)
    update(session, actor, kind, row, move.columns, action="carry", reason=why)
    for request_id, point in move.points.items():
        request = session.get_one(ObservationRequestRow, request_id)
        columns = {"observation_point": dict(point)}
        update(
            session,
            actor,
            OBSERVATION_REQUEST,
            request,
            columns,
            action="carry",
            reason=why,
        )
