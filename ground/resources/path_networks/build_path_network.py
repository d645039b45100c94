"""Compute the path network of a mission: a job."""

from __future__ import annotations

from collections.abc import Mapping

from sqlalchemy.orm import Session

from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.jobs.row import JobRow
from ground.jobs.value import Job
from ground.records.actor import SYSTEM_ACTOR, Action, Actor
from ground.records.edit import insert, new_row, update
from ground.records.get_resource import find_row
from ground.resources.ask_job import ask_job
from ground.resources.missions.kind import MISSION
from ground.resources.path_networks.bodies import PathNetworkCreate
from ground.resources.path_networks.kind import PATH_NETWORK
from ground.resources.path_networks.order import ORDERS, NetworkOrder
from ground.resources.path_networks.row import PathNetworkRow
from ground.resources.problems.inputs_digest import inputs_digest
from ground.resources.problems.mission_day import choose_sol, mission_day, worksite

KIND = "build_path_network"


def build_path_network(repo: Repository, actor: Actor, mission_id: str, given: PathNetworkCreate) -> Job:
    """Return the job whose subject is the new network."""
    actor.require(Action.PLAN, mission_id)
    with repo.database.write() as session:
        mission = find_row(session, MISSION, mission_id)
        sol = choose_sol(session, mission_id, given.sol_id)
        job_id, inputs = new_id("job"), inputs_digest(session, mission_id)
        row = new_row(
            PATH_NETWORK, actor, mission_id, given, job_id=job_id, inputs_sha256=inputs, geometry=None
        )
        insert(session, actor, PATH_NETWORK, row)
        order = NetworkOrder(worksite(repo, session, mission), mission_day(repo, session, mission, sol))
        payload = ORDERS.document(order)
        return ask_job(session, repo, actor, KIND, mission_id, (PATH_NETWORK, row.id), payload, job_id)


def settle(_repo: Repository, session: Session, job: JobRow, result: Mapping[str, object]) -> str | None:
    """Write the geometry and the observation points that were found."""
    row = session.get(PathNetworkRow, job.subject_id)
    if row is None:
        return None
    update(session, SYSTEM_ACTOR, PATH_NETWORK, row, {"geometry": result["geometry"]}, action="compute")
    return f"/api/v1/path-networks/{row.id}"
