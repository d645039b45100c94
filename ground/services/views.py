"""Rows of the repository as the values that people and programs see.

Many at once, so that the names of related rows cost one query; mapped rows and plain result rows both do.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from functools import cache
from typing import Any, TypeVar, cast

from sqlalchemy import func, select
from sqlalchemy.orm import Session

from ground.errors import StateError
from ground.gdr import frame_values as f
from ground.gdr import models as m
from ground.gdr import values as v
from ground.services.inputs_digest import inputs_digest

T = TypeVar("T")

NO_GEOMETRY: Mapping[str, Any] = {
    "nodes": [],
    "segments": [],
    "regions": [],
    "hazards_m": [],
    "margins_m": [],
    "unreachable": {},
    "notes": [],
}


@cache
def _members(value: Callable[..., Any]) -> tuple[str, ...]:
    return tuple(field.name for field in dataclasses.fields(cast("Any", value)))


def _value(value: Callable[..., T], row: Any, /, **given: Any) -> T:
    """Return a value whose members are the row's columns of the same name, but for those given."""
    columns = {name: getattr(row, name) for name in _members(value) if name not in given}
    return value(**columns, **given)


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
        _value(
            v.Mission,
            r,
            terrain_name=names.get(r.terrain_id, ""),
            counts=counts[r.id],
            drive_rules=[v.DriveRule(**rule) for rule in r.drive_rules or ()],
        )
        for r in rows
    ]


def pose_of(document: Mapping[str, Any]) -> v.Pose:
    """Return a pose from its JSON form."""
    return v.Pose(float(document["east_m"]), float(document["north_m"]), float(document["heading_rad"]))


def show_sols(_session: object, rows: Sequence[m.SolRow]) -> list[v.Sol]:
    return [
        _value(
            v.Sol, r, start_pose=pose_of(r.start_pose), passes=[v.CommunicationPass(**p) for p in r.passes]
        )
        for r in rows
    ]


def show_targets(_session: object, rows: Sequence[m.TargetRow]) -> list[v.Target]:
    return [_value(v.Target, r, position=v.Point(r.east_m, r.north_m, r.up_m)) for r in rows]


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
        _value(
            v.ObservationRequest,
            r,
            target_name=names.get(r.target_id, ""),
            instrument=v.Instrument(r.instrument),
            observation_point=observation_point_of(r.observation_point),
            state=v.RequestState(r.state),
        )
        for r in rows
    ]


def show_keep_outs(_session: object, rows: Sequence[m.KeepOutRow]) -> list[v.KeepOut]:
    return [_value(v.KeepOut, r) for r in rows]


def show_networks(session: Session, rows: Sequence[m.PathNetworkRow]) -> list[v.PathNetwork]:
    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    out = []
    for r in rows:
        geometry = r.geometry or NO_GEOMETRY
        out.append(
            _value(
                v.PathNetwork,
                r,
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
                computed=r.geometry is not None,
            )
        )
    return out


def show_problems(_session: object, rows: Sequence[m.ProblemRow]) -> list[v.Problem]:
    return [_value(v.Problem, r) for r in rows]


def show_plans(session: Session, rows: Sequence[m.PlanRow]) -> list[v.Plan]:
    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    return [
        _value(v.Plan, r, state=v.PlanState(r.state), stale=now[r.mission_id] != r.inputs_sha256)
        for r in rows
    ]


def show_runs(_session: object, rows: Sequence[m.RunRow]) -> list[v.Run]:
    return [
        _value(
            v.Run,
            r,
            kind=v.RunKind(r.kind),
            faults=[v.Fault(**f) for f in r.faults],
            state=v.JobState(r.state),
        )
        for r in rows
    ]


def show_products(_session: object, rows: Sequence[m.ProductRow]) -> list[v.Product]:
    return [
        _value(v.Product, r, orphan=r.request_id is None, file_url=f"/api/v1/products/{r.id}/file")
        for r in rows
    ]


def show_comments(_session: object, rows: Sequence[m.CommentRow]) -> list[v.Comment]:
    return [_value(v.Comment, r) for r in rows]


def show_jobs(_session: object, rows: Sequence[m.JobRow]) -> list[v.Job]:
    return [
        _value(
            v.Job,
            r,
            state=v.JobState(r.state),
            log=[v.LogLine(datetime.fromisoformat(line["at_utc"]), line["text"]) for line in r.log],
        )
        for r in rows
    ]


def show_approvals(session: Session, rows: Sequence[m.ApprovalRow]) -> list[v.Approval]:
    p = m.PlanRow
    query = select(p.id, p.state, p.inputs_sha256).where(p.id.in_({r.plan_id for r in rows}))
    plans = {plan.id: plan for plan in session.execute(query)}
    now = {i: inputs_digest(session, i) for i in {r.mission_id for r in rows}}
    out_of_hand = {v.PlanState.UPLINKED, v.PlanState.EXECUTED}
    return [
        _value(
            v.Approval,
            r,
            approver=r.author,
            void=plans[r.plan_id].state not in out_of_hand
            and (
                plans[r.plan_id].state != v.PlanState.APPROVED
                or plans[r.plan_id].inputs_sha256 != now[r.mission_id]
            ),
        )
        for r in rows
    ]


def show_people(_session: object, rows: Sequence[m.PersonRow]) -> list[v.Person]:
    return [_value(v.Person, r, role=v.Role(r.role)) for r in rows]


def show_uploads(_session: object, rows: Sequence[m.UploadRow]) -> list[v.Upload]:
    return [_value(v.Upload, r) for r in rows]


# ---- the site chain


def show_frames(session: Session, rows: Sequence[m.FrameRow]) -> list[f.Frame]:
    """Return frames with their places, by the chain of each mission once."""
    from ground.services.site_chain import load_chain

    chains = {i: load_chain(session, i) for i in {r.mission_id for r in rows}}
    s = m.SolutionRow
    counted = select(s.frame_id, func.count()).where(s.mission_id.in_(chains)).group_by(s.frame_id)
    counts = dict(session.execute(counted).all())
    declared: dict[tuple[str, tuple[int, ...]], list[int]] = {}
    files = select(m.FrameFileRow.mission_id, m.FrameFileRow.aliases).order_by(m.FrameFileRow.id)
    for file in session.execute(files.where(m.FrameFileRow.mission_id.in_(chains))):
        for alias in file.aliases:
            declared.setdefault((file.mission_id, tuple(alias["new"])), alias["old"])
    shown = []
    for r in rows:
        place, reason = None, ""
        try:
            place = chains[r.mission_id].place(r.id)
        except StateError as err:
            reason = err.message
        known = declared.get((r.mission_id, tuple(r.counter))) if r.level == "site" else None
        shown.append(
            _value(
                f.Frame,
                r,
                level=f.Level(r.level),
                declared_at=known,
                solutions=counts.get(r.id, 0),
                place=place,
                reason=reason,
            )
        )
    return shown


def show_solutions(session: Session, rows: Sequence[m.SolutionRow]) -> list[f.Solution]:
    """Return solutions and whether each is in use."""
    frames = select(m.FrameRow.solution_id).where(m.FrameRow.id.in_({r.frame_id for r in rows}))
    used = set(session.scalars(frames))
    return [_value(f.Solution, r, in_use=r.id in used) for r in rows]


def show_frame_files(_session: object, rows: Sequence[m.FrameFileRow]) -> list[f.FrameFile]:
    return [_value(f.FrameFile, r) for r in rows]


def show_site_maps(_session: object, rows: Sequence[m.SiteMapRow]) -> list[f.SiteMap]:
    return [_value(f.SiteMap, r, file_url=f"/api/v1/site-maps/{r.id}/file") for r in rows]


def show_traverses(_session: object, rows: Sequence[m.TraverseRow]) -> list[f.Traverse]:
    return [_value(f.Traverse, r, stops=[f.TraverseStop(**stop) for stop in r.stops]) for r in rows]
