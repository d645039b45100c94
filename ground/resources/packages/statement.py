"""Make what people sign of a plan, with digests taken from the text as it stands now."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from importlib.metadata import version
from typing import Any

import orjson
from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.checks.flight_rules import flight_rules
from ground.day.rovers import profile_of
from ground.errors import StateError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import find_row
from ground.resources.missions.row import MissionRow
from ground.resources.packages.row import CounterRow, PackageRow, SignatureRow, StatementRow
from ground.resources.packages.value import Signed, Statement
from ground.resources.plans.kind import PLAN
from ground.resources.plans.row import PlanRow
from ground.resources.plans.value import PlanState
from ground.resources.problems.inputs_digest import inputs_digest
from ground.resources.runs.row import RunRow
from ground.resources.runs.value import RunKind
from ground.resources.sols.row import SolRow
from ground.resources.targets.row import TargetRow
from ground.uplink.package import json_text, manifest_text

LIFE = timedelta(days=7)
"""From issue to the latest start on board: a week holds a planning cycle and its relay passes."""

_TIMES = ("counter", "issued_utc", "expires_utc")


def models_digest(rover_profile: str) -> str:
    """Return the SHA-256 over what turned inputs into the plan: program, rover profile, flight rules."""
    content = {
        "outcrop": version("outcrop"),
        "profile": profile_of(rover_profile).sha256,
        "rules": [asdict(rule) for rule in flight_rules()],
    }
    return hashlib.sha256(orjson.dumps(content, option=orjson.OPT_SORT_KEYS)).hexdigest()


def require_fresh(session: Session, plan: PlanRow) -> None:
    """Raise `StateError` if the mission was edited since the plan was asked for."""
    if inputs_digest(session, plan.mission_id) != plan.inputs_sha256:
        raise StateError(
            f"the mission was edited since plan {plan.number} was computed; plan anew "
            "(any edit voids an approval)"
        )


def make_statement(repo: Repository, actor: Actor, plan_id: str) -> Statement:
    """Return what is to be signed of a verified plan; a new one where the last does not hold any more.

    Raises
    ------
    StateError
        If the plan is neither verified nor approved, is stale, or its text is not what was computed.
    """
    with repo.database.write() as session:
        plan: PlanRow = find_row(session, PLAN, plan_id, lock=True)
        actor.require(Action.PLAN, plan.mission_id)
        found = current_statement(session, plan)
        if found is None:
            landmarks = json_text(_landmarks(session, plan))
            run = _verifying_run(session, plan, None)
            now = datetime.now(UTC)
            about = {
                **_about(session, plan, run),
                "counter": _next_counter(session, plan.mission_id),
                "issued_utc": now.isoformat(timespec="seconds"),
                "expires_utc": (now + LIFE).isoformat(timespec="seconds"),
            }
            manifest = manifest_text(about, plan_text(plan), landmarks)
            found = StatementRow(
                id=new_id("stm"),
                author=actor.name,
                mission_id=plan.mission_id,
                plan_id=plan.id,
                counter=about["counter"],
                sha256=hashlib.sha256(manifest.encode()).hexdigest(),
                manifest=manifest,
                landmarks=landmarks,
            )
            session.add(found)
            session.flush()
        return show_statement(session, found, current=True)


def read_statement(repo: Repository, actor: Actor, plan_id: str) -> Statement | None:
    """Return the last statement of a plan, with its signatures; None if nothing was made to be signed yet."""
    with repo.database.read() as session:
        plan: PlanRow = find_row(session, PLAN, plan_id)
        actor.require(Action.READ, plan.mission_id)
        row = last_statement(session, plan)
        if row is None:
            return None
        try:
            current = current_statement(session, plan) is row
        except StateError:
            current = False
        return show_statement(session, row, current=current or plan.state in _OUT)


_OUT = {PlanState.UPLINKED.value, PlanState.EXECUTED.value}


def last_statement(session: Session, plan: PlanRow) -> StatementRow | None:
    """Return the newest statement of a plan; one whose row was changed afterwards is none."""
    query = select(StatementRow).where(StatementRow.plan_id == plan.id).order_by(StatementRow.counter.desc())
    return next((row for row in session.scalars(query) if _is_whole(row)), None)


def _is_whole(row: StatementRow) -> bool:
    """Return whether a statement's text is that of its digest, and says what is read of it."""
    manifest, landmarks = str(row.manifest), str(row.landmarks)  # SQLite keeps what is put into a column
    if manifest != row.manifest or landmarks != row.landmarks:
        return False
    if hashlib.sha256(manifest.encode("utf-8", "surrogatepass")).hexdigest() != row.sha256:
        return False
    try:
        said = json.loads(manifest)
        aware = datetime.fromisoformat(said["expires_utc"]).tzinfo is not None
        named = [said["verification"]["run"], said["verification"]["verifier"]]
        same = bool(said["counter"] == row.counter)
        return aware and same and all(isinstance(name, str) for name in named)
    except (ValueError, KeyError, TypeError, RecursionError):
        return False


def current_statement(session: Session, plan: PlanRow) -> StatementRow | None:
    """Return the newest statement of a plan if all that it says is still so, else None.

    Raises
    ------
    StateError
        If no statement can be made of the plan at all; the message says why.
    """
    if plan.state not in {PlanState.VERIFIED.value, PlanState.APPROVED.value}:
        raise StateError(f"plan {plan.number} is {plan.state}; only a verified plan is signed")
    require_fresh(session, plan)
    row = last_statement(session, plan)
    if row is None:
        _verifying_run(session, plan, None)
        plan_text(plan)
        return None
    said: dict[str, Any] = json.loads(row.manifest)
    if datetime.fromisoformat(said["expires_utc"]) <= datetime.now(UTC):
        return None
    run = _verifying_run(session, plan, said["verification"]["run"])
    times = {name: said[name] for name in _TIMES}
    now = manifest_text({**_about(session, plan, run), **times}, plan_text(plan), row.landmarks)
    return row if now == row.manifest else None


def plan_text(plan: PlanRow) -> str:
    """Return the canonical text of a plan, from the text that is stored.

    Raises
    ------
    StateError
        If it is not the text that was computed and verified.
    """
    from executive.crl import CrlError, canonical_text, parse

    try:
        text = canonical_text(parse(plan.crl_text or ""))
    except (CrlError, RecursionError) as err:
        raise StateError(f"the text of plan {plan.number} is not CRL any more") from err
    if hashlib.sha256(text.encode()).hexdigest() != plan.crl_sha256:
        raise StateError(f"the text of plan {plan.number} was changed since it was computed")
    return text


def show_statement(session: Session, row: StatementRow, *, current: bool) -> Statement:
    """Return the value of a statement."""
    query = select(SignatureRow).where(SignatureRow.statement_id == row.id).order_by(SignatureRow.id)
    signatures = tuple(
        Signed(s.role, s.author, s.key_id, s.signature, s.created_utc) for s in session.scalars(query)
    )
    return Statement(
        id=row.id,
        mission_id=row.mission_id,
        plan_id=row.plan_id,
        counter=row.counter,
        sha256=row.sha256,
        manifest=row.manifest,
        current=current,
        expires_utc=datetime.fromisoformat(json.loads(row.manifest)["expires_utc"]),
        signatures=signatures,
        created_utc=row.created_utc,
    )


def _verifying_run(session: Session, plan: PlanRow, run_id: str | None) -> RunRow:
    """Return the run, made here, by which a plan is verified: that one if it is, else the newest."""
    runs = select(RunRow).where(
        RunRow.plan_id == plan.id,
        RunRow.kind == RunKind.DRY_RUN.value,
        RunRow.outcome == "SUCCEEDED",
        RunRow.crl_sha256 == plan.crl_sha256,
        RunRow.elsewhere.is_(False),
    )
    named = None if run_id is None else session.scalars(runs.where(RunRow.id == run_id)).first()
    run = named or session.scalars(runs.order_by(RunRow.id.desc()).limit(1)).first()
    if run is None:
        raise StateError(f"no dry run of plan {plan.number} that was made here went through")
    return run


def _about(session: Session, plan: PlanRow, run: RunRow) -> dict[str, Any]:
    """Return what a manifest says of a plan as it stands."""
    profile = profile_of(plan.rover_profile)
    language = profile.language
    return {
        "mission": plan.mission_id,
        "mission_name": session.get_one(MissionRow, plan.mission_id).name,
        "plan": plan.id,
        "plan_number": plan.number,
        "sol": session.get_one(SolRow, plan.sol_id).number,
        "terrain_sha256": plan.terrain_sha256,
        "dictionary": {"name": language.name, "version": language.version, "sha256": language.sha256},
        "profile": {"name": profile.name, "version": profile.version, "sha256": profile.sha256},
        "models_sha256": models_digest(plan.rover_profile),
        "author": plan.author,
        "verification": {
            "run": run.id,
            "verifier": run.author,
            "rover": run.rover,
            "seed": run.seed,
            "outcome": run.outcome,
            "trace_sha256": run.trace_sha256,
            "telemetry_sha256": run.telemetry_sha256,
        },
    }


def _landmarks(session: Session, plan: PlanRow) -> Mapping[str, Any]:
    query = select(TargetRow).where(TargetRow.mission_id == plan.mission_id).order_by(TargetRow.id)
    return {
        "format": "landmarks/1",
        "frame": "site",
        "axes": "east, north, up; metres",
        "start": session.get_one(SolRow, plan.sol_id).start_pose,
        "targets": [
            {
                "id": t.id,
                "name": t.name,
                "point_m": [t.east_m, t.north_m, t.up_m],
                "normal": t.normal,
                "covariance_m2": t.covariance_m2,
            }
            for t in session.scalars(query)
        ],
    }


def _next_counter(session: Session, mission_id: str) -> int:
    row = session.get(CounterRow, mission_id, with_for_update=True, populate_existing=True)
    if row is None:
        packed = select(PackageRow.sequence).where(PackageRow.mission_id == mission_id)
        row = CounterRow(mission_id=mission_id, last=max(session.scalars(packed), default=0))
        session.add(row)
    row.last += 1
    session.flush()
    return row.last
