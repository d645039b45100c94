"""Compute the path network of a mission: a job."""

from __future__ import annotations

from typing import Any

from sqlalchemy.orm import Session

from ground import jobs
from ground.errors import NotFoundError
from ground.gdr import models as m
from ground.gdr import values as v
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.services.actor import SYSTEM_ACTOR, Action, Actor
from ground.services.day_inputs import choose_sol, day_inputs
from ground.services.edit import insert, update
from ground.services.inputs_digest import inputs_digest
from ground.services.kinds import KINDS
from ground.services.views import show_jobs

KIND = "build_path_network"


def build_path_network(
    repo: Repository, actor: Actor, mission_id: str, *, sol_id: str | None = None
) -> v.Job:
    """Return the job whose subject is the new network."""
    actor.require(Action.PLAN, mission_id)
    with repo.database.write() as session:
        mission = session.get(m.MissionRow, mission_id)
        if mission is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        sol = choose_sol(session, mission_id, sol_id)
        network_id, job_id = new_id("net"), new_id("job")
        row = m.PathNetworkRow(
            id=network_id,
            author=actor.name,
            mission_id=mission_id,
            job_id=job_id,
            inputs_sha256=inputs_digest(session, mission_id),
            geometry=None,
        )
        insert(session, actor, KINDS["path_network"], row)
        job = jobs.enqueue(
            session,
            repo.settings,
            kind=KIND,
            mission_id=mission_id,
            subject_kind="path_network",
            subject_id=network_id,
            payload=day_inputs(repo, session, mission, sol),
            author=actor.name,
            job_id=job_id,
        )
        value = show_jobs(session, [job])[0]
    jobs.WAKE.set()
    return value


def settle(_repo: Repository, session: Session, job: m.JobRow, result: dict[str, Any]) -> str | None:
    """Write the geometry and the observation points that were found."""
    row = session.get(m.PathNetworkRow, job.subject_id)
    if row is None:
        return None
    update(
        session, SYSTEM_ACTOR, KINDS["path_network"], row, {"geometry": result["geometry"]}, action="compute"
    )
    return f"/api/v1/path-networks/{row.id}"


def abandon(_session: Session, _job: m.JobRow) -> None:
    """Leave the network as it is: without geometry."""
