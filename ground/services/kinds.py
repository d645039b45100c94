"""The kinds of resource that are listed, read, changed and undone in one way."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Select, select

from ground.gdr import models as m
from ground.services import views
from ground.services.actor import Action


@dataclass(frozen=True, slots=True)
class Kind:
    """How one kind of resource is stored and shown.

    `show` maps rows to values, many at once so that names of related rows cost one query; rows of the mapper
    and plain result rows of `shown()` will both do. `edit` is the right needed to change it.
    """

    name: str
    title: str
    prefix: str
    collection: str
    row: type[m.Row]
    show: Callable[[Any, Sequence[Any]], list[Any]]
    edit: Action
    fields: frozenset[str] = frozenset()
    """What a person may set; everything else is computed."""
    undoable: bool = False
    related: bool = False
    """Whether `show` reads other rows too, and so needs a session that sees one state of the database."""
    unseen: frozenset[str] = frozenset()
    """Columns that `show` has no use for; the large ones would cost more than all the others."""

    def shown(self) -> Select[Any]:
        """Return the query for the columns that `show` needs, without conditions."""
        return select(*(c for c in self.row.__table__.c if c.name not in self.unseen))


_ALL = (
    Kind(
        "mission",
        "mission",
        "msn",
        "missions",
        m.MissionRow,
        views.show_missions,
        Action.EDIT_MISSION,
        frozenset({"name", "notes", "rover_profile", "anchor_frame_id", "calibration", "drive_rules"}),
        undoable=True,
        related=True,
    ),
    Kind(
        "sol",
        "sol",
        "sol",
        "sols",
        m.SolRow,
        views.show_sols,
        Action.EDIT_MISSION,
        frozenset(
            {
                "number",
                "notes",
                "start_pose",
                "start_utc",
                "start_lmst_h",
                "battery_j",
                "energy_floor_j",
                "time_budget_s",
                "energy_budget_j",
                "overrun_penalty",
                "passes",
                "uplink_deadline_utc",
            }
        ),
        undoable=True,
    ),
    Kind(
        "target",
        "target",
        "tgt",
        "targets",
        m.TargetRow,
        views.show_targets,
        Action.EDIT_SCIENCE,
        frozenset({"name", "notes", "east_m", "north_m", "source_image", "frame_id"}),
        undoable=True,
    ),
    Kind(
        "observation_request",
        "observation request",
        "req",
        "observation-requests",
        m.ObservationRequestRow,
        views.show_requests,
        Action.EDIT_SCIENCE,
        frozenset(
            {
                "instrument",
                "value",
                "tracked",
                "window_s",
                "after",
                "must_do",
                "dwell_s",
                "notes",
                "observation_pose",
                "state",
            }
        ),
        undoable=True,
        related=True,
    ),
    Kind(
        "keep_out",
        "keep-out",
        "kpo",
        "keep-outs",
        m.KeepOutRow,
        views.show_keep_outs,
        Action.EDIT_MISSION,
        frozenset({"name", "notes", "polygon_m", "frame_id"}),
        undoable=True,
    ),
    Kind(
        "frame",
        "frame",
        "frm",
        "frames",
        m.FrameRow,
        views.show_frames,
        Action.EDIT_MISSION,
        frozenset({"notes"}),
        undoable=True,
        related=True,
    ),
    Kind(
        "solution",
        "localization solution",
        "sln",
        "solutions",
        m.SolutionRow,
        views.show_solutions,
        Action.EDIT_MISSION,
        frozenset({"notes"}),
        undoable=True,
        related=True,
    ),
    Kind(
        "frame_file",
        "frame file",
        "frf",
        "frame-files",
        m.FrameFileRow,
        views.show_frame_files,
        Action.EDIT_MISSION,
        undoable=True,
    ),
    Kind(
        "site_map",
        "site map",
        "map",
        "site-maps",
        m.SiteMapRow,
        views.show_site_maps,
        Action.EDIT_MISSION,
        frozenset({"name", "notes"}),
        undoable=True,
    ),
    Kind(
        "traverse",
        "traverse",
        "trv",
        "traverses",
        m.TraverseRow,
        views.show_traverses,
        Action.PLAN,
        frozenset({"name", "notes"}),
    ),
    Kind(
        "path_network",
        "path network",
        "net",
        "path-networks",
        m.PathNetworkRow,
        views.show_networks,
        Action.PLAN,
        related=True,
    ),
    Kind("problem", "planning problem", "prb", "problems", m.ProblemRow, views.show_problems, Action.PLAN),
    Kind(
        "plan",
        "plan",
        "pln",
        "plans",
        m.PlanRow,
        views.show_plans,
        Action.PLAN,
        frozenset({"name", "notes"}),
        related=True,
        unseen=frozenset({"tree", "summary", "crl_text", "findings"}),
    ),
    Kind("run", "run", "run", "runs", m.RunRow, views.show_runs, Action.PLAN, frozenset({"notes"})),
    Kind("product", "data product", "prd", "products", m.ProductRow, views.show_products, Action.UPLINK),
    Kind(
        "comment",
        "comment",
        "cmt",
        "comments",
        m.CommentRow,
        views.show_comments,
        Action.COMMENT,
        frozenset({"text"}),
    ),
    Kind("job", "job", "job", "jobs", m.JobRow, views.show_jobs, Action.PLAN, unseen=frozenset({"payload"})),
    Kind(
        "approval",
        "approval",
        "apv",
        "approvals",
        m.ApprovalRow,
        views.show_approvals,
        Action.APPROVE,
        related=True,
    ),
    Kind(
        "person",
        "person",
        "psn",
        "people",
        m.PersonRow,
        views.show_people,
        Action.ADMINISTER,
        frozenset({"role", "mission_roles", "active"}),
        unseen=frozenset({"password_hash"}),
    ),
    Kind("upload", "upload", "upl", "uploads", m.UploadRow, views.show_uploads, Action.EDIT_SCIENCE),
)
KINDS: Mapping[str, Kind] = {kind.name: kind for kind in _ALL}
