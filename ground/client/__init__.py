"""A typed client of the REST interface, and the values that it gives."""

from ground.client.rest import ApiError, Client, ServerUnreachableError
from ground.jobs.value import Job
from ground.resources.approvals.value import Approval
from ground.resources.comments.value import Comment
from ground.resources.frames.value import Frame
from ground.resources.keep_outs.value import KeepOut
from ground.resources.missions.value import Mission
from ground.resources.observation_requests.value import ObservationRequest
from ground.resources.path_networks.value import PathNetwork
from ground.resources.people.value import Person
from ground.resources.plans.value import Plan
from ground.resources.problems.value import Problem
from ground.resources.products.value import Product
from ground.resources.runs.value import Run
from ground.resources.site_maps.value import SiteMap
from ground.resources.sols.value import Sol
from ground.resources.solutions.value import FrameFile, Solution
from ground.resources.targets.value import Target
from ground.resources.traverses.value import Traverse

__all__ = [
    "ApiError",
    "Approval",
    "Client",
    "Comment",
    "Frame",
    "FrameFile",
    "Job",
    "KeepOut",
    "Mission",
    "ObservationRequest",
    "PathNetwork",
    "Person",
    "Plan",
    "Problem",
    "Product",
    "Run",
    "ServerUnreachableError",
    "SiteMap",
    "Sol",
    "Solution",
    "Target",
    "Traverse",
]
