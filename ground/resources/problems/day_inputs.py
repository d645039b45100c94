"""Gather a mission's day as it goes to the planner."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, StateError
from ground.gdr.repository import Repository
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.keep_outs.rules import kept_clear
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import terrain_row
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.sols.row import SolRow
from ground.resources.targets.row import TargetRow

TO_PLAN = ("open", "planned", "carried", "attempted", "failed")
"""States of requests that a new plan takes up; what is satisfied is not asked for again."""


def choose_sol(session: Session, mission_id: str, sol_id: str | None) -> SolRow:
    """Return the sol named, else the newest of the mission.

    Raises
    ------
    InvalidInputError
        If the mission has no such sol.
    StateError
        If it has none at all.
    """
    if sol_id is not None:
        sol = session.get(SolRow, sol_id)
        if sol is None or sol.mission_id != mission_id:
            raise InvalidInputError(f"there is no sol {sol_id} in mission {mission_id}", pointer="/sol_id")
        return sol
    newest = session.scalars(
        select(SolRow).where(SolRow.mission_id == mission_id).order_by(SolRow.number.desc()).limit(1)
    ).first()
    if newest is None:
        raise StateError("the mission has no sol; open one, so that there is a start and a budget")
    return newest


def day_inputs(
    repo: Repository, session: Session, mission: MissionRow, sol: SolRow, request_ids: Collection[str] = ()
) -> dict[str, Any]:
    """Return terrain, rover, limits, targets, requests and keep-outs as plain data.

    Raises
    ------
    InvalidInputError
        If a request asked for is not in the mission.
    """
    rows = list(
        session.scalars(
            select(ObservationRequestRow)
            .where(ObservationRequestRow.mission_id == mission.id)
            .order_by(ObservationRequestRow.id)
        )
    )
    if request_ids:
        known = {row.id for row in rows}
        for index, wanted in enumerate(request_ids):
            if wanted not in known:
                raise InvalidInputError(
                    f"there is no observation request {wanted} in mission {mission.id}",
                    pointer=f"/request_ids/{index}",
                )
        rows = [row for row in rows if row.id in set(request_ids)]
    else:
        rows = [row for row in rows if row.state in TO_PLAN]
    chosen = {row.id for row in rows}
    wanted_targets = {row.target_id for row in rows}
    targets = session.scalars(
        select(TargetRow).where(TargetRow.mission_id == mission.id).order_by(TargetRow.id)
    )
    keep_outs = session.scalars(
        select(KeepOutRow).where(KeepOutRow.mission_id == mission.id).order_by(KeepOutRow.id)
    )
    ground = terrain_row(session, mission.id)
    return {
        "mission_id": mission.id,
        "terrain_dir": str(repo.terrain_dir(ground.id)),
        "rover_profile": mission.rover_profile,
        "calibration": mission.calibration,
        "drive_rules": [
            rule
            for rule in mission.drive_rules or ()
            if {rule["from_target_id"], rule["to_target_id"]} <= {None, *wanted_targets}
        ],
        "limits": {
            "name": f"{mission.name} sol {sol.number}",
            "start": sol.start_pose,
            "time_s": sol.time_budget_s,
            "energy_j": max(0.0, min(sol.energy_budget_j, sol.battery_j - sol.energy_floor_j)),
            "overrun_penalty": sol.overrun_penalty,
            "data_mbit": sum(p["data_mbit"] for p in sol.passes) or None,
            "refs": {"mission": mission.id, "sol": str(sol.number)},
        },
        "targets": [
            {
                "id": t.id,
                "name": t.name,
                "point_site": [t.east_m, t.north_m, t.up_m],
                "normal_site": t.normal,
            }
            for t in targets
            if t.id in wanted_targets
        ],
        "requests": [
            {
                "id": r.id,
                "target_id": r.target_id,
                "instrument": r.instrument,
                "value": r.value,
                "tracked": r.tracked,
                "window_s": r.window_s,
                "after": [i for i in r.after if i in chosen],
                "must_do": r.must_do,
                "dwell_s": r.dwell_s,
                "observation_pose": manual_pose(r),
            }
            for r in rows
        ],
        "keep_outs": [{"id": k.id, "polygon_m": kept_clear(k.polygon_m, k.sigma_m)} for k in keep_outs],
    }


def manual_pose(request: ObservationRequestRow) -> dict[str, float] | None:
    """Return the pose that a person set by hand, else None."""
    point = request.observation_point
    return point["pose"] if point is not None and point["manual"] else None
