"""The kinds of resource that are listed, read, changed and undone in one way."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Select, func, select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError
from ground.gdr import models as m
from ground.gdr import values as v
from ground.services.actor import Action


@dataclass(frozen=True, slots=True)
class Page:
    """One page of a list; `next_cursor` is null on the last."""

    items: list[Any]
    next_cursor: str | None


@dataclass(frozen=True, slots=True)
class Kind:
    """How one kind of resource is stored and shown.

    `show` maps rows to values, many at once so that names of related rows cost one query; rows of the mapper
    and plain result rows of `shown()` will both do. `edit` is the right needed to change it.
    """

    name: str
    title: str
    prefix: str
    collection: str
    row: type[m.Row]
    show: Callable[[Any, Sequence[Any]], list[Any]]
    edit: Action
    fields: frozenset[str] = frozenset()
    """What a person may set; everything else is computed."""
    undoable: bool = False
    related: bool = False
    """Whether `show` reads other rows too, and so needs a session that sees one state of the database."""
    unseen: frozenset[str] = frozenset()
    """Columns that `show` has no use for; the large ones would cost more than all the others."""

    def shown(self) -> Select[Any]:
        """Return the query for the columns that `show` needs, without conditions."""
        return select(*(c for c in self.row.__table__.c if c.name not in self.unseen))


def _counts(session: Session, mission_ids: Sequence[str]) -> dict[str, v.Counts]:
    tables: Mapping[str, Any] = {
        "targets": m.TargetRow,
        "observation_requests": m.ObservationRequestRow,
        "plans": m.PlanRow,
        "runs": m.RunRow,
        "products": m.ProductRow,
    }
    found: dict[str, dict[str, int]] = {i: dict.fromkeys(tables, 0) for i in mission_ids}
    for name, row in tables.items():
        query = (
            select(row.mission_id, func.count())
            .where(row.mission_id.in_(mission_ids))
            .group_by(row.mission_id)
        )
        for mission_id, count in session.execute(query):
            found[mission_id][name] = count
    return {i: v.Counts(**c) for i, c in found.items()}


def show_missions(session: Session, rows: Sequence[m.MissionRow]) -> list[v.Mission]:
    counts = _counts(session, [r.id for r in rows])
    names = dict(
        session.execute(
            select(m.TerrainRow.id, m.TerrainRow.name).where(
                m.TerrainRow.id.in_([r.terrain_id for r in rows])
            )
        ).all()
    )
    return [
        v.Mission(
            id=r.id,
            name=r.name,
            notes=r.notes,
            terrain_id=r.terrain_id,
            terrain_name=names.get(r.terrain_id, ""),
            copied_from=r.copied_from,
            rover_profile=r.rover_profile,
            counts=counts[r.id],
            author=r.author,
            created_utc=r.created_utc,
            modified_utc=r.modified_utc,
            revision=r.revision,
        )
        for r in rows
    ]


def pose_of(document: Mapping[str, Any]) -> v.Pose:
    """Return a pose from its JSON form."""
    return v.Pose(float(document["east_m"]), float(document["north_m"]), float(document["heading_rad"]))


def show_sols(_session: object, rows: Sequence[m.SolRow]) -> list[v.Sol]:
    return [
        v.Sol(
            id=r.id,
            mission_id=r.mission_id,
            number=r.number,
            notes=r.notes,
            start_pose=pose_of(r.start_pose),
            start_utc=r.start_utc,
            start_lmst_h=r.start_lmst_h,
            battery_j=r.battery_j,
            energy_floor_j=r.energy_floor_j,
            time_budget_s=r.time_budget_s,
            energy_budget_j=r.energy_budget_j,
            overrun_penalty=r.overrun_penalty,
            passes=[v.CommunicationPass(**p) for p in r.passes],
            uplink_deadline_utc=r.uplink_deadline_utc,
            author=r.author,
            created_utc=r.created_utc,
            modified_utc=r.modified_utc,
            revision=r.revision,
        )
        for r in rows
    ]


def show_targets(_session: object, rows: Sequence[m.TargetRow]) -> list[v.Target]:
    return [
        v.Target(
            id=r.id,
            mission_id=r.mission_id,
            name=r.name,
            notes=r.notes,
            position=v.Point(r.east_m, r.north_m, r.up_m),
            normal=r.normal,
            slope_rad=r.slope_rad,
            covariance_m2=r.covariance_m2,
            source_image=r.source_image,
            author=r.author,
            created_utc=r.created_utc,
            modified_utc=r.modified_utc,
            revision=r.revision,
        )
        for r in rows
    ]


def observation_point_of(document: Mapping[str, Any] | None) -> v.ObservationPoint | None:
    """Return an observation point from its JSON form."""
    if document is None:
        return None
    pose = document["pose"]
    return v.ObservationPoint(
        pose=None if pose is None else pose_of(pose),
        reachable=document["reachable"],
        manual=document["manual"],
        reason=document["reason"],
    )


def show_requests(session: Session, rows: Sequence[m.ObservationRequestRow]) -> list[v.ObservationRequest]:
    names = dict(
        session.execute(
            select(m.TargetRow.id, m.TargetRow.name).where(m.TargetRow.id.in_({r.target_id for r in rows}))
        ).all()
    )
    return [
        v.ObservationRequest(
            id=r.id,
            mission_id=r.mission_id,
            target_id=r.target_id,
            target_name=names.get(r.target_id, ""),
            instrument=v.Instrument(r.instrument),
            value=r.value,
            tracked=r.tracked,
            window_s=r.window_s,
            after=r.after,
            must_do=r.must_do,
            dwell_s=r.dwell_s,
            notes=r.notes,
            observation_point=observation_point_of(r.observation_point),
            state=v.RequestState(r.state),
            state_reason=r.state_reason,
            author=r.author,
            created_utc=r.created_utc,
            modified_utc=r.modified_utc,
            revision=r.revision,
        )
        for r in rows
    ]


def show_keep_outs(_session: object, rows: Sequence[m.KeepOutRow]) -> list[v.KeepOut]:
    return [
        v.KeepOut(
            id=r.id,
            mission_id=r.mission_id,
            name=r.name,
            notes=r.notes,
            polygon_m=r.polygon_m,
            author=r.author,
            created_utc=r.created_utc,
            modified_utc=r.modified_utc,
            revision=r.revision,
        )
        for r in rows
    ]


NO_GEOMETRY: Mapping[str, Any] = {
    "nodes": [],
    "segments": [],
    "regions": [],
    "hazards_m": [],
    "margins_m": [],
    "unreachable": {},
    "notes": [],
}


def show_networks(session: Session, rows: Sequence[m.PathNetworkRow]) -> list[v.PathNetwork]:
    from ground.services.inputs_digest import inputs_digest

    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    out = []
    for r in rows:
        geometry = r.geometry or NO_GEOMETRY
        out.append(
            v.PathNetwork(
                id=r.id,
                mission_id=r.mission_id,
                inputs_sha256=r.inputs_sha256,
                stale=now[r.mission_id] != r.inputs_sha256,
                nodes=[
                    v.NetworkNode(n["id"], pose_of(n["pose"]), n["target_id"], n["request_ids"])
                    for n in geometry["nodes"]
                ],
                segments=[v.NetworkSegment(**s) for s in geometry["segments"]],
                regions=[v.TrackingRegion(**g) for g in geometry["regions"]],
                hazards_m=geometry["hazards_m"],
                margins_m=geometry["margins_m"],
                unreachable=geometry["unreachable"],
                notes=geometry["notes"],
                job_id=r.job_id,
                computed=r.geometry is not None,
                author=r.author,
                created_utc=r.created_utc,
                revision=r.revision,
            )
        )
    return out


def show_problems(_session: object, rows: Sequence[m.ProblemRow]) -> list[v.Problem]:
    return [v.Problem(r.id, r.mission_id, r.sha256, r.document, r.author, r.created_utc) for r in rows]


def show_plans(session: Session, rows: Sequence[m.PlanRow]) -> list[v.Plan]:
    from ground.services.inputs_digest import inputs_digest

    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    return [
        v.Plan(
            id=r.id,
            mission_id=r.mission_id,
            sol_id=r.sol_id,
            parent_id=r.parent_id,
            number=r.number,
            name=r.name,
            notes=r.notes,
            state=v.PlanState(r.state),
            status=r.status,
            strategy=r.strategy,
            max_branches=r.max_branches,
            time_limit_s=r.time_limit_s,
            iterations=r.iterations,
            seed=r.seed,
            job_id=r.job_id,
            problem_id=r.problem_id,
            network_id=r.network_id,
            expected_utility=r.expected_utility,
            standard_error=r.standard_error,
            lower=r.lower,
            upper=r.upper,
            branches=r.branches,
            crl_sha256=r.crl_sha256,
            problem_sha256=r.problem_sha256,
            terrain_sha256=r.terrain_sha256,
            dictionary=r.dictionary,
            rover_profile=r.rover_profile,
            planned_request_ids=r.planned_request_ids,
            left_out=r.left_out,
            stale=now[r.mission_id] != r.inputs_sha256,
            author=r.author,
            approved_by=r.approved_by,
            created_utc=r.created_utc,
            modified_utc=r.modified_utc,
            revision=r.revision,
        )
        for r in rows
    ]


def show_runs(_session: object, rows: Sequence[m.RunRow]) -> list[v.Run]:
    return [
        v.Run(
            id=r.id,
            mission_id=r.mission_id,
            plan_id=r.plan_id,
            kind=v.RunKind(r.kind),
            rover=r.rover,
            seed=r.seed,
            faults=[v.Fault(**f) for f in r.faults],
            job_id=r.job_id,
            state=v.JobState(r.state),
            outcome=r.outcome,
            utility=r.utility,
            duration_s=r.duration_s,
            energy_used_j=r.energy_used_j,
            options_taken=r.options_taken,
            achieved_request_ids=r.achieved_request_ids,
            crl_sha256=r.crl_sha256,
            notes=r.notes,
            author=r.author,
            created_utc=r.created_utc,
            modified_utc=r.modified_utc,
            revision=r.revision,
        )
        for r in rows
    ]


def show_products(_session: object, rows: Sequence[m.ProductRow]) -> list[v.Product]:
    return [
        v.Product(
            id=r.id,
            mission_id=r.mission_id,
            run_id=r.run_id,
            plan_id=r.plan_id,
            task_id=r.task_id,
            request_id=r.request_id,
            target_id=r.target_id,
            kind=r.kind,
            instrument=r.instrument,
            media=r.media,
            file_name=r.file_name,
            size_bytes=r.size_bytes,
            sha256=r.sha256,
            t_s=r.t_s,
            label=r.label,
            orphan=r.request_id is None,
            file_url=f"/api/v1/products/{r.id}/file",
            created_utc=r.created_utc,
        )
        for r in rows
    ]


def show_comments(_session: object, rows: Sequence[m.CommentRow]) -> list[v.Comment]:
    return [
        v.Comment(
            r.id,
            r.mission_id,
            r.subject_kind,
            r.subject_id,
            r.text,
            r.author,
            r.created_utc,
            r.modified_utc,
            r.revision,
        )
        for r in rows
    ]


def show_jobs(_session: object, rows: Sequence[m.JobRow]) -> list[v.Job]:
    from datetime import datetime

    return [
        v.Job(
            id=r.id,
            mission_id=r.mission_id,
            kind=r.kind,
            state=v.JobState(r.state),
            progress=r.progress,
            message=r.message,
            attempt=r.attempt,
            cancel_requested=r.cancel_requested,
            subject_kind=r.subject_kind,
            subject_id=r.subject_id,
            result_url=r.result_url,
            problem=r.problem,
            log=[v.LogLine(datetime.fromisoformat(line["at_utc"]), line["text"]) for line in r.log],
            author=r.author,
            created_utc=r.created_utc,
            started_utc=r.started_utc,
            finished_utc=r.finished_utc,
            revision=r.revision,
        )
        for r in rows
    ]


def show_approvals(session: Session, rows: Sequence[m.ApprovalRow]) -> list[v.Approval]:
    from ground.services.inputs_digest import inputs_digest

    p = m.PlanRow
    query = select(p.id, p.state, p.inputs_sha256).where(p.id.in_({r.plan_id for r in rows}))
    plans = {plan.id: plan for plan in session.execute(query)}
    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    out_of_hand = {v.PlanState.UPLINKED, v.PlanState.EXECUTED}
    return [
        v.Approval(
            id=r.id,
            mission_id=r.mission_id,
            plan_id=r.plan_id,
            approver=r.author,
            note=r.note,
            crl_sha256=r.crl_sha256,
            terrain_sha256=r.terrain_sha256,
            dictionary_sha256=r.dictionary_sha256,
            models_sha256=r.models_sha256,
            void=plans[r.plan_id].state not in out_of_hand
            and (
                plans[r.plan_id].state != v.PlanState.APPROVED
                or plans[r.plan_id].inputs_sha256 != now[r.mission_id]
            ),
            created_utc=r.created_utc,
        )
        for r in rows
    ]


def show_people(_session: object, rows: Sequence[m.PersonRow]) -> list[v.Person]:
    return [v.Person(r.id, r.name, v.Role(r.role), r.mission_roles, r.active, r.revision) for r in rows]


def show_uploads(_session: object, rows: Sequence[m.UploadRow]) -> list[v.Upload]:
    return [v.Upload(r.id, r.file_name, r.size_bytes, r.sha256, r.author, r.created_utc) for r in rows]


_ALL = (
    Kind(
        "mission",
        "mission",
        "msn",
        "missions",
        m.MissionRow,
        show_missions,
        Action.EDIT_MISSION,
        frozenset({"name", "notes", "rover_profile"}),
        undoable=True,
        related=True,
    ),
    Kind(
        "sol",
        "sol",
        "sol",
        "sols",
        m.SolRow,
        show_sols,
        Action.EDIT_MISSION,
        frozenset(
            {
                "number",
                "notes",
                "start_pose",
                "start_utc",
                "start_lmst_h",
                "battery_j",
                "energy_floor_j",
                "time_budget_s",
                "energy_budget_j",
                "overrun_penalty",
                "passes",
                "uplink_deadline_utc",
            }
        ),
        undoable=True,
    ),
    Kind(
        "target",
        "target",
        "tgt",
        "targets",
        m.TargetRow,
        show_targets,
        Action.EDIT_SCIENCE,
        frozenset({"name", "notes", "east_m", "north_m", "source_image"}),
        undoable=True,
    ),
    Kind(
        "observation_request",
        "observation request",
        "req",
        "observation-requests",
        m.ObservationRequestRow,
        show_requests,
        Action.EDIT_SCIENCE,
        frozenset(
            {
                "instrument",
                "value",
                "tracked",
                "window_s",
                "after",
                "must_do",
                "dwell_s",
                "notes",
                "observation_pose",
                "state",
            }
        ),
        undoable=True,
        related=True,
    ),
    Kind(
        "keep_out",
        "keep-out",
        "kpo",
        "keep-outs",
        m.KeepOutRow,
        show_keep_outs,
        Action.EDIT_MISSION,
        frozenset({"name", "notes", "polygon_m"}),
        undoable=True,
    ),
    Kind(
        "path_network",
        "path network",
        "net",
        "path-networks",
        m.PathNetworkRow,
        show_networks,
        Action.PLAN,
        related=True,
    ),
    Kind("problem", "planning problem", "prb", "problems", m.ProblemRow, show_problems, Action.PLAN),
    Kind(
        "plan",
        "plan",
        "pln",
        "plans",
        m.PlanRow,
        show_plans,
        Action.PLAN,
        frozenset({"name", "notes"}),
        related=True,
        unseen=frozenset({"tree", "summary", "crl_text", "findings"}),
    ),
    Kind("run", "run", "run", "runs", m.RunRow, show_runs, Action.PLAN, frozenset({"notes"})),
    Kind("product", "data product", "prd", "products", m.ProductRow, show_products, Action.UPLINK),
    Kind(
        "comment",
        "comment",
        "cmt",
        "comments",
        m.CommentRow,
        show_comments,
        Action.COMMENT,
        frozenset({"text"}),
    ),
    Kind("job", "job", "job", "jobs", m.JobRow, show_jobs, Action.PLAN, unseen=frozenset({"payload"})),
    Kind(
        "approval",
        "approval",
        "apv",
        "approvals",
        m.ApprovalRow,
        show_approvals,
        Action.APPROVE,
        related=True,
    ),
    Kind(
        "person",
        "person",
        "psn",
        "people",
        m.PersonRow,
        show_people,
        Action.ADMINISTER,
        frozenset({"role", "mission_roles", "active"}),
        unseen=frozenset({"password_hash"}),
    ),
    Kind("upload", "upload", "upl", "uploads", m.UploadRow, show_uploads, Action.EDIT_SCIENCE),
)
KINDS: Mapping[str, Kind] = {kind.name: kind for kind in _ALL}


def encode_cursor(last_id: str) -> str:
    """Return an opaque cursor that goes on behind a row."""
    return base64.urlsafe_b64encode(last_id.encode()).decode().rstrip("=")


def decode_cursor(cursor: str) -> str:
    """Return the id behind which a page begins.

    Raises
    ------
    InvalidInputError
        If the cursor was not made by `encode_cursor`.
    """
    try:
        text = base64.urlsafe_b64decode(cursor.encode("ascii") + b"=" * (-len(cursor) % 4)).decode("ascii")
    except (binascii.Error, UnicodeError, ValueError) as err:
        raise InvalidInputError("the cursor was not made here", pointer="/cursor") from err
    if not text or not all(c.isalnum() or c == "-" for c in text):
        raise InvalidInputError("the cursor was not made here", pointer="/cursor")
    return text
