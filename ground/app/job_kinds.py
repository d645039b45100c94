"""The kinds of long work there are."""

from __future__ import annotations

from collections.abc import Mapping

from ground.jobs.queue import JobKind
from ground.resources.calibrations import calibrate_mission
from ground.resources.calibrations import work as calibration_work
from ground.resources.path_networks import build_path_network
from ground.resources.path_networks import work as network_work
from ground.resources.plans import generate_plan
from ground.resources.plans import work as plan_work
from ground.resources.runs import dry_run
from ground.resources.runs import work as run_work
from ground.resources.traverses import adjust_traverse
from ground.resources.traverses import work as traverse_work


def job_kinds() -> Mapping[str, JobKind]:
    """Return every kind by its name."""
    kinds = (
        JobKind(
            build_path_network.KIND, network_work.work, build_path_network.settle, build_path_network.abandon
        ),
        JobKind(generate_plan.KIND, plan_work.work, generate_plan.settle, generate_plan.abandon),
        JobKind(adjust_traverse.KIND, traverse_work.work, adjust_traverse.settle, adjust_traverse.abandon),
        JobKind(
            calibrate_mission.KIND, calibration_work.work, calibrate_mission.settle, calibrate_mission.abandon
        ),
        JobKind(dry_run.KIND, run_work.work, dry_run.settle, dry_run.abandon, dry_run.begin),
    )
    return {kind.name: kind for kind in kinds}
