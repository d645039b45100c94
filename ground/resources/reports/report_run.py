"""Report a run on one page for the uplink meeting."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sqlalchemy import select

from ground.errors import StateError
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.get_resource import find_row
from ground.reports.page import (
    confidence_chart,
    failure_table,
    map_picture,
    number,
    page,
    table,
    tree_drawing,
)
from ground.reports.plan_drawing import target_names
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import mission_terrain
from ground.resources.observation_requests.kind import OBSERVATION_REQUEST
from ground.resources.observation_requests.row import ObservationRequestRow
from ground.resources.observation_requests.value import ObservationRequest
from ground.resources.plans.read_plan import computed_plan
from ground.resources.plans.row import PlanRow
from ground.resources.problems.row import ProblemRow
from ground.resources.products.kind import PRODUCT
from ground.resources.products.row import ProductRow
from ground.resources.products.value import Product
from ground.resources.runs.kind import RUN
from ground.resources.runs.read_run import read_telemetry, read_trace
from ground.resources.runs.trace_value import Telemetry, Trace
from ground.resources.runs.value import Run
from ground.uplink.link import FORMAT
from ground.uplink.rehearsal import GROUND_VIEW

if TYPE_CHECKING:
    from planner.plan_tree_document import TreeDocument


def report_run(repo: Repository, actor: Actor, run_id: str) -> str:
    """Return the report of a run that is over as one HTML document that loads nothing.

    Map with what was planned and driven, plan tree, odds, each request with what came back, what is most
    likely to go wrong with the plan, and what failed in this run.

    Raises
    ------
    StateError
        While the run is not over.
    """
    trace, telemetry = read_trace(repo, actor, run_id), read_telemetry(repo, actor, run_id)
    with repo.database.read() as session:
        run_row = find_row(session, RUN, run_id)
        run = RUN.show_one(session, run_row)
        plan = computed_plan(session, actor, run.plan_id)
        if plan.problem_id is None:
            raise StateError(f"plan {plan.number} has no planning problem")
        mission = session.get_one(MissionRow, plan.mission_id)
        problem = session.get_one(ProblemRow, plan.problem_id).document
        terrain = mission_terrain(repo, session, mission.id)
        r, p, k = ObservationRequestRow, ProductRow, KeepOutRow
        query = select(r).where(r.mission_id == mission.id).order_by(r.id)
        requests = OBSERVATION_REQUEST.show(session, list(session.scalars(query)))
        found = session.scalars(select(p).where(p.run_id == run_id).order_by(p.id))
        products = PRODUCT.show(session, list(found))
        keep_outs = list(session.scalars(select(k.polygon_m).where(k.mission_id == mission.id)))
    lost = [t for t, states in telemetry.tracker_state.items() if "lost" in states]
    driven = [
        (east, north)
        for east, north in zip(telemetry.east_m, telemetry.north_m, strict=True)
        if east is not None and north is not None
    ]
    tree: TreeDocument = plan.tree or {"plan": ()}
    names = target_names(problem)
    picture = map_picture(
        terrain,
        problem,
        tree,
        "map of plan and drive",
        driven_m=driven,
        observed=Counter(x.target_id for x in products if x.target_id is not None),
        lost=lost,
        keep_outs=keep_outs,
    )
    asked = ("target", "instrument", "value", "in the plan", "came back")
    parts = [
        table((), _figures(run, plan, [names.get(t, t) for t in lost])),
        "<h2>Map</h2>",
        picture,
        "<h2>Plan</h2>",
        tree_drawing(tree, problem),
        "<h2>Requests and what came back</h2>",
        table(asked, _rows(plan, requests, products), numbers=(2,)),
        *_tracking(telemetry, names),
        "<h2>Top failure modes</h2>",
        failure_table(tree, problem),
        "<h2>What failed</h2>",
        table(("time, s", "task", "end"), _failures(trace), numbers=(0,)) or "<p>Nothing.</p>",
        *known_on_the_ground(repo.run_dir(run_id) / GROUND_VIEW, trace),
    ]
    return page(f"{mission.name}: plan {plan.number}, run {run.id}", parts)


def _tracking(telemetry: Telemetry, names: Mapping[str, str]) -> list[str]:
    """Return each target's tracker confidence over the distance driven, nothing where none was tracked."""
    ways: list[float | None] = []
    way, before = 0.0, None
    for east, north in zip(telemetry.east_m, telemetry.north_m, strict=True):
        if east is None or north is None:
            ways.append(None)
            continue
        if before is not None:
            way += math.hypot(east - before[0], north - before[1])
        before = (east, north)
        ways.append(way)
    curves = {names.get(t, t): values for t, values in telemetry.tracker_confidence.items()}
    chart = confidence_chart(ways, curves, "confidence of the trackers over the distance driven")
    return ["<h2>Confidence of the trackers</h2>", chart] if chart else []


def _figures(run: Run, plan: PlanRow, lost: Sequence[str]) -> list[tuple[str, str]]:
    expected = f"{number(plan.expected_utility)}, at most {number(plan.upper)}"
    return [
        ("outcome", run.outcome),
        ("utility", f"{number(run.utility)} (expected {expected})"),
        ("duration", number(run.duration_s, " s")),
        ("energy used", number(run.energy_used_j, " J")),
        ("options taken", ", ".join(run.options_taken) or "none"),
        ("tracks lost", ", ".join(lost) or "none"),
        ("rover", f"{run.rover}, seed {run.seed}"),
        ("CRL SHA-256", run.crl_sha256),
    ]


def _rows(
    plan: PlanRow, requests: Sequence[ObservationRequest], products: Sequence[Product]
) -> list[tuple[object, ...]]:
    rows: list[tuple[object, ...]] = []
    for request in requests:
        files = [p.file_name for p in products if p.request_id == request.id]
        inside = (
            "yes" if request.id in plan.planned_request_ids else plan.left_out.get(request.id, "not asked")
        )
        what = (request.target_name, request.instrument, f"{request.value:g}")
        rows.append((*what, inside, ", ".join(files) or "nothing"))
    orphans = [p.file_name for p in products if p.request_id is None]
    if orphans:
        rows.append(("no request", "", "", "", ", ".join(orphans)))
    return rows


def _failures(trace: Trace) -> list[tuple[Any, ...]]:
    """Return the nodes that ended in failure, with their times."""
    bad = {"FAILED", "ABORTED"}
    return [
        (f"{e.t_s:.0f}", e.arguments[0], " ".join(e.arguments[1:]))
        for e in trace.events
        if e.event == "end" and bad & set(e.arguments[1:])
    ]


def known_on_the_ground(path: Path, trace: Trace) -> list[str]:
    """Return the chapter on what the ground knew when, of a rehearsal with a link; else nothing.

    The folder may come from elsewhere: a file of another form counts for nothing.
    """
    try:
        view = json.loads(path.read_text(encoding="utf-8"))
        return _ground_view(view, trace) if view["format"] == FORMAT else []
    except (OSError, ValueError, TypeError, LookupError):
        return []


def _ground_view(view: Mapping[str, Any], trace: Trace) -> list[str]:
    passes = ", ".join(f"{p['name']} {p['start_s']:.0f} to {p['end_s']:.0f} s" for p in view["passes"])
    link = [
        ("one-way light time", f"{view['light_time_s']:g} s"),
        ("passes", passes or "contact at all times"),
        (
            "end of the run",
            f"{_seconds(trace.end_s)}, known on the ground at {_seconds(view['end_known_s'])}",
        ),
    ]
    sent = [(c["operation"], _seconds(c["sent_s"]), _seconds(c["heard_s"])) for c in view["commands"]]
    told = [
        (e.arguments[0], " ".join(e.arguments[1:]), _seconds(e.t_s), _seconds(known))
        for e, (_, _, known) in zip(trace.events, view["records"], strict=False)
        if e.event == "end"
    ]
    came = [
        (p["path"], f"{p['mbit']:.2f} Mbit", _seconds(p["t_s"]), _seconds(p["known_s"]))
        for p in view["products"]
    ]
    return [
        "<h2>Known on the ground</h2>",
        table((), link),
        table(("command", "sent", "heard by the rover"), sent, numbers=(1, 2)),
        table(("task", "end", "on board at", "known at"), told, numbers=(2, 3)),
        table(("product", "volume", "made at", "whole at"), came, numbers=(1, 2, 3)),
    ]


def _seconds(value: float | None) -> str:
    return "never" if value is None else f"{value:,.0f} s"
