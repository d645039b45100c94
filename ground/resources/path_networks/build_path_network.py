"""Compute the path network of a mission: a job."""

from __future__ import annotations

from typing import Any

from sqlalchemy.orm import Session

from ground.errors import NotFoundError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.kind import show_jobs
from ground.jobs.queue import WAKE, enqueue
from ground.jobs.row import JobRow
from ground.jobs.value import Job
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, update
from ground.resources.missions.row import MissionRow
from ground.resources.path_networks.kind import PATH_NETWORK
from ground.resources.path_networks.order import ORDERS, NetworkOrder
from ground.resources.path_networks.row import PathNetworkRow
from ground.resources.problems.inputs_digest import inputs_digest
from ground.resources.problems.mission_day import choose_sol, mission_day, worksite

KIND = "build_path_network"


def build_path_network(repo: Repository, actor: Actor, mission_id: str, *, sol_id: str | None = None) -> Job:
    """Return the job whose subject is the new network."""
    actor.require(Action.PLAN, mission_id)
    with repo.database.write() as session:
        mission = session.get(MissionRow, mission_id)
        if mission is None:
            raise NotFoundError(f"there is no mission {mission_id}")
        sol = choose_sol(session, mission_id, sol_id)
        network_id, job_id = new_id("net"), new_id("job")
        row = PathNetworkRow(
            id=network_id,
            author=actor.name,
            mission_id=mission_id,
            job_id=job_id,
            inputs_sha256=inputs_digest(session, mission_id),
            geometry=None,
        )
        insert(session, actor, PATH_NETWORK, row)
        order = NetworkOrder(worksite(repo, session, mission), mission_day(session, mission, sol))
        job = enqueue(
            session,
            repo.settings,
            kind=KIND,
            mission_id=mission_id,
            subject_kind="path_network",
            subject_id=network_id,
            payload=ORDERS.document(order),
            author=actor.name,
            job_id=job_id,
        )
        value = show_jobs(session, [job])[0]
    WAKE.set()
    return value


def settle(_repo: Repository, session: Session, job: JobRow, result: dict[str, Any]) -> str | None:
    """Write the geometry and the observation points that were found."""
    row = session.get(PathNetworkRow, job.subject_id)
    if row is None:
        return None
    update(session, SYSTEM_ACTOR, PATH_NETWORK, row, {"geometry": result["geometry"]}, action="compute")
    return f"/api/v1/path-networks/{row.id}"


def abandon(_session: Session, _job: JobRow) -> None:
    """Leave the network as it is: without geometry."""
