"""Tell whether what a result was computed from is still what stands in the mission."""

from __future__ import annotations

import hashlib

import orjson
from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.gdr.history import ChainRow
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.keep_outs.rules import kept_clear
from ground.resources.missions.row import MissionRow
from ground.resources.observation_requests.row import PLANNED, ObservationRequestRow
from ground.resources.sols.row import SolRow
from ground.resources.targets.row import TargetRow
from ground.resources.terrains.row import TerrainRow

KEPT = 512
_kept: dict[tuple[str, str], str] = {}


def inputs_digest(session: Session, mission_id: str) -> str:
    """Return the SHA-256 over all that a path network or plan of the mission is computed from.

    Names and notes do not count; positions, requests, keep-outs, drive rules, budgets, terrain, rover profile
    and calibration do. Every change moves the head of the mission's history, so a digest once taken is kept
    under that head.
    """
    head = session.scalar(select(ChainRow.sha256).where(ChainRow.id == mission_id))
    known = _kept.get((mission_id, head or ""))
    if known is not None:
        return known
    digest = _take(session, mission_id)
    if len(_kept) >= KEPT:
        _kept.clear()
    _kept[(mission_id, head or "")] = digest
    return digest


def _take(session: Session, mission_id: str) -> str:
    t, o, k, s = TargetRow, ObservationRequestRow, KeepOutRow, SolRow
    parts = [
        session.execute(
            select(TerrainRow.sha256, MissionRow.rover_profile)
            .join(MissionRow, MissionRow.terrain_id == TerrainRow.id)
            .where(MissionRow.id == mission_id)
        ).all(),
        session.execute(
            select(t.id, t.east_m, t.north_m, t.up_m).where(t.mission_id == mission_id).order_by(t.id)
        ).all(),
        session.execute(
            select(
                o.id,
                o.target_id,
                o.instrument,
                o.value,
                o.tracked,
                o.window_s,
                o.after,
                o.must_do,
                o.dwell_s,
                o.observation_point,
            )
            .where(o.mission_id == mission_id)
            .order_by(o.id)
        ).all(),
        [
            (row.id, kept_clear(row.polygon_m, row.sigma_m))
            for row in session.execute(
                select(k.id, k.polygon_m, k.sigma_m).where(k.mission_id == mission_id).order_by(k.id)
            )
        ],
        session.execute(
            select(
                s.id,
                s.start_pose,
                s.battery_j,
                s.energy_floor_j,
                s.time_budget_s,
                s.energy_budget_j,
                s.overrun_penalty,
            )
            .where(s.mission_id == mission_id)
            .order_by(s.id)
        ).all(),
    ]
    calibration = session.scalar(select(MissionRow.calibration).where(MissionRow.id == mission_id))
    if calibration is not None:  # without one, digests are as they were before missions had any
        parts.append([(calibration,)])
    rules = session.scalar(select(MissionRow.drive_rules).where(MissionRow.id == mission_id))
    if rules:  # likewise
        parts.append([(rules,)])
    for column in (c for c in o.__table__.c if c.info.get(PLANNED)):
        told = select(o.id, column).where(o.mission_id == mission_id, column.is_not(None)).order_by(o.id)
        if rows := session.execute(told).all():  # likewise
            parts.append(rows)
    content = [[[_counting(value) for value in row] for row in part] for part in parts]
    return hashlib.sha256(orjson.dumps(content, option=orjson.OPT_SORT_KEYS)).hexdigest()


def _counting(value: object) -> object:
    """Leave away observation points that the program found: they follow from the rest."""
    if isinstance(value, dict) and "manual" in value:
        return value["pose"] if value["manual"] else None
    return value
