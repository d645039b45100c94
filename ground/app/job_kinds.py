"""The kinds of long work there are."""

from __future__ import annotations

from collections.abc import Mapping

from ground.jobs.queue import JobKind
from ground.resources.calibrations import calibrate_mission
from ground.resources.calibrations import work as calibration_work
from ground.resources.calibrations.order import ORDERS as CALIBRATION_ORDERS
from ground.resources.campaigns import fly_campaign
from ground.resources.campaigns import work as campaign_work
from ground.resources.campaigns.order import ORDERS as CAMPAIGN_ORDERS
from ground.resources.downlinks import import_recording
from ground.resources.downlinks import work as recording_work
from ground.resources.downlinks.order import ORDERS as RECORDING_ORDERS
from ground.resources.executions import execute_plan
from ground.resources.executions import work as execution_work
from ground.resources.executions.order import ORDERS as EXECUTION_ORDERS
from ground.resources.path_networks import build_path_network
from ground.resources.path_networks import work as network_work
from ground.resources.path_networks.order import ORDERS as NETWORK_ORDERS
from ground.resources.plans import generate_plan
from ground.resources.plans import work as plan_work
from ground.resources.plans.order import ORDERS as PLAN_ORDERS
from ground.resources.runs import dry_run
from ground.resources.runs import work as run_work
from ground.resources.runs.live_work import live_work
from ground.resources.runs.order import ORDERS as RUN_ORDERS
from ground.resources.traverses import adjust_traverse
from ground.resources.traverses import work as traverse_work
from ground.resources.traverses.order import ORDERS as TRAVERSE_ORDERS


def job_kinds() -> Mapping[str, JobKind]:
    """Return every kind by its name."""
    kinds = (
        JobKind(
            build_path_network.KIND,
            NETWORK_ORDERS,
            network_work.work,
            build_path_network.settle,
            interactive=True,
        ),
        JobKind(generate_plan.KIND, PLAN_ORDERS, plan_work.work, generate_plan.settle, generate_plan.abandon),
        JobKind(adjust_traverse.KIND, TRAVERSE_ORDERS, traverse_work.work, adjust_traverse.settle),
        JobKind(calibrate_mission.KIND, CALIBRATION_ORDERS, calibration_work.work, calibrate_mission.settle),
        JobKind(
            execute_plan.KIND,
            EXECUTION_ORDERS,
            execution_work.work,
            execute_plan.settle,
            begin=execute_plan.begin,
        ),
        JobKind(
            import_recording.KIND,
            RECORDING_ORDERS,
            recording_work.work,
            import_recording.settle,
            import_recording.abandon,
        ),
        JobKind(
            fly_campaign.KIND,
            CAMPAIGN_ORDERS,
            campaign_work.work,
            fly_campaign.settle,
            fly_campaign.abandon,
            fly_campaign.begin,
        ),
        JobKind(
            dry_run.KIND,
            RUN_ORDERS,
            run_work.work,
            dry_run.settle,
            dry_run.abandon,
            lasts=dry_run.begin,
            interactive=True,
        ),
        JobKind(
            dry_run.LIVE_KIND,
            RUN_ORDERS,
            live_work,
            dry_run.settle,
            dry_run.abandon,
            dry_run.begin,
            live=True,
        ),
    )
    return {kind.name: kind for kind in kinds}
