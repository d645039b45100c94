"""All kinds of resource, and what follows in one noun from a change in another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from ground.jobs.kind import JOB
from ground.records.kind import Kind
from ground.resources.approvals.kind import APPROVAL
from ground.resources.campaigns.kind import CAMPAIGN
from ground.resources.comments.kind import COMMENT
from ground.resources.drafts.kind import DRAFT
from ground.resources.frames.kind import FRAME
from ground.resources.keep_outs.change_keep_out import change_keep_out
from ground.resources.keep_outs.kind import KEEP_OUT
from ground.resources.merge_bases.kind import MERGE_BASE
from ground.resources.mission_setup.change_mission import change_mission
from ground.resources.missions.kind import MISSION
from ground.resources.observation_requests.change_request import (
    change_request,
    forget_precedence,
    hold_order,
    prepare_request,
)
from ground.resources.observation_requests.change_target import change_target, forget_requests, prepare_target
from ground.resources.observation_requests.create_request import foresee_requests
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.path_networks.kind import PATH_NETWORK
from ground.resources.people.kind import PERSON
from ground.resources.plans.keep_plan import keep_approved_plan, keep_planned_sol
from ground.resources.plans.kind import PLAN
from ground.resources.problems.kind import PROBLEM
from ground.resources.products.kind import PRODUCT
from ground.resources.runs.keep_run import keep_run_plan
from ground.resources.runs.kind import RUN
from ground.resources.site_maps.kind import SITE_MAP
from ground.resources.sols.change_sol import change_sol
from ground.resources.sols.kind import SOL
from ground.resources.solutions.kind import FRAME_FILE, SOLUTION
from ground.resources.targets.create_target import foresee_targets
from ground.resources.targets.forget_drives import forget_drives
from ground.resources.targets.kind import TARGET
from ground.resources.traverses.kind import TRAVERSE
from ground.resources.uploads.kind import UPLOAD
from ground.resources.webhooks.kind import WEBHOOK

_ALL = (
    replace(MISSION, apply=change_mission),
    replace(SOL, apply=change_sol, forget=(keep_planned_sol,)),
    replace(
        TARGET,
        foresee=foresee_targets,
        prepare=prepare_target,
        apply=change_target,
        forget=(forget_requests, forget_drives),
    ),
    replace(
        OBSERVATION_REQUEST,
        foresee=foresee_requests,
        prepare=prepare_request,
        apply=change_request,
        forget=(forget_precedence,),
        hold=hold_order,
    ),
    replace(KEEP_OUT, apply=change_keep_out),
    FRAME,
    SOLUTION,
    FRAME_FILE,
    SITE_MAP,
    TRAVERSE,
    PATH_NETWORK,
    PROBLEM,
    replace(PLAN, forget=(keep_approved_plan, keep_run_plan)),
    RUN,
    CAMPAIGN,
    PRODUCT,
    COMMENT,
    DRAFT,
    JOB,
    APPROVAL,
    MERGE_BASE,
    PERSON,
    UPLOAD,
    WEBHOOK,
)
KINDS: Mapping[str, Kind[Any]] = {kind.name: kind for kind in _ALL}
