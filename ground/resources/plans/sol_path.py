"""Ask for a sol path, and read what the sols after the planned one are worth."""

from __future__ import annotations

from collections.abc import Mapping

from ground.errors import NotFoundError
from ground.gdr.repository import Repository
from ground.jobs.value import Job
from ground.records.actor import Actor
from ground.resources.plans.bodies import PlanCreate
from ground.resources.plans.generate_plan import generate_plan
from ground.resources.plans.order import Ahead
from ground.resources.plans.read_plan import read_summary
from ground.resources.plans.sol_path_bodies import SolPathCreate


def ask_sol_path(repo: Repository, actor: Actor, mission_id: str, given: SolPathCreate) -> Job:
    """Return the job whose subject is the plan of the first sol, a draft until it is computed.

    Raises
    ------
    InvalidInputError
        If the power of the sols contradicts itself.
    """
    series = None if given.power is None else given.power.series(given.sols)
    plan = PlanCreate(**given.model_dump(exclude={"sols", "power"}))
    return generate_plan(repo, actor, mission_id, plan, ahead=Ahead(given.sols, series))


def read_sol_path(repo: Repository, actor: Actor, plan_id: str) -> Mapping[str, object]:
    """Return what the sols of a plan's sol path are worth, `sol-path/1`.

    Raises
    ------
    NotFoundError
        If the plan is for a single sol.
    """
    found = read_summary(repo, actor, plan_id).get("sol_path")
    if not isinstance(found, Mapping):
        raise NotFoundError(f"plan {plan_id} is for a single sol; POST .../sol-paths plans several")
    return found
