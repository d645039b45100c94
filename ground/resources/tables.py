"""All tables of the repository: whoever needs the whole schema imports it from here."""

from __future__ import annotations

from ground.gdr.base import Base
from ground.gdr.history import ChainRow, EventRow
from ground.jobs.row import JobRow
from ground.records.idempotency import IdempotencyRow
from ground.resources.approvals.row import ApprovalRow, WaiverRow
from ground.resources.comments.row import CommentRow
from ground.resources.frames.row import FrameFileRow, FrameRow, SolutionRow
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.missions.row import ElsewhereRow, MissionRow
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.packages.row import CounterRow, PackageRow, SignatureRow, StatementRow
from ground.resources.path_networks.row import PathNetworkRow
from ground.resources.people.row import CredentialRow, LoginFailureRow, PersonRow, SigningKeyRow
from ground.resources.plans.row import PlanRow
from ground.resources.problems.row import ProblemRow
from ground.resources.products.row import ProductRow
from ground.resources.runs.row import RunRow
from ground.resources.site_maps.row import SiteMapRow
from ground.resources.sols.row import SolRow
from ground.resources.targets.row import TargetRow
from ground.resources.terrains.row import TerrainRow
from ground.resources.traverses.row import TraverseRow
from ground.resources.uploads.row import UploadRow

ROWS = (
    ChainRow,
    EventRow,
    JobRow,
    IdempotencyRow,
    TerrainRow,
    MissionRow,
    SolRow,
    TargetRow,
    ObservationRequestRow,
    KeepOutRow,
    FrameRow,
    FrameFileRow,
    SolutionRow,
    SiteMapRow,
    TraverseRow,
    PathNetworkRow,
    ProblemRow,
    PlanRow,
    RunRow,
    ProductRow,
    CommentRow,
    ApprovalRow,
    WaiverRow,
    CounterRow,
    StatementRow,
    SignatureRow,
    PackageRow,
    ElsewhereRow,
    UploadRow,
    PersonRow,
    CredentialRow,
    SigningKeyRow,
    LoginFailureRow,
)
METADATA = Base.metadata
