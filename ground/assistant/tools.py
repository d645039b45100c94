"""What an assistant may ask for: reading, and drafts. Nothing here approves, signs, packages or sends.

The key decides, not this list: a server holds a key with the role `assistant` to the same, whoever uses it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from itertools import islice
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, Literal

from pydantic import Field

from ground.assistant.marking import handed
from ground.client import Client
from mission.codec import Document

Id = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")]
Metres = Annotated[float, Field(ge=-1e5, le=1e5, allow_inf_nan=False)]
Name = Annotated[str, Field(max_length=80)]
Words = Annotated[str, Field(max_length=2000)]
Number = Annotated[float, Field(ge=0.0, le=1e6, allow_inf_nan=False)]
Seconds = Annotated[float, Field(ge=0.0, le=1e7, allow_inf_nan=False)]
Corners = Annotated[
    list[Annotated[list[Metres], Field(min_length=2, max_length=2)]], Field(min_length=3, max_length=500)
]
Window = Annotated[list[Seconds], Field(min_length=2, max_length=2)]
Many = Annotated[int, Field(ge=1, le=500)]


class Tools:
    """The tools over one client; each answers with a document in which texts of others are marked."""

    def __init__(self, client: Client) -> None:
        self._client = client

    # ---- reading

    def list_missions(self) -> Mapping[str, object]:
        """List the missions that can be seen."""
        return self._all(self._client.list_missions(), 500)

    def list_targets(self, mission_id: Id, limit: Many = 200) -> Mapping[str, object]:
        """List targets of a mission with their places (site frame, metres)."""
        return self._all(self._client.list_targets(mission_id), limit)

    def list_requests(self, mission_id: Id, limit: Many = 200) -> Mapping[str, object]:
        """List observation requests of a mission with their states and the reasons of those."""
        return self._all(self._client.list_observation_requests(mission_id), limit)

    def list_plans(self, mission_id: Id, limit: Many = 50) -> Mapping[str, object]:
        """List plans of a mission with their states, values and bounds."""
        return self._all(self._client.list_plans(mission_id), limit)

    def read_plan(self, plan_id: Id) -> Mapping[str, object]:
        """Read a plan and its summary: what it does, and why requests are left out."""
        plan = self._client.get_plan(plan_id)
        summary = self._client.get_plan_summary(plan_id) if plan["problem_id"] else {}
        return handed({"plan": plan, "summary": summary})

    def why_not(self, plan_id: Id, request_id: Id) -> Mapping[str, object]:
        """Say why a plan leaves a request out, or how it stands in it."""
        return handed(self._client.explain_request(plan_id, request_id))

    def list_runs(self, mission_id: Id, limit: Many = 50) -> Mapping[str, object]:
        """List dry runs and executions of a mission with their outcomes."""
        return self._all(self._client.list_runs(mission_id), limit)

    def read_terrain(self, mission_id: Id) -> Mapping[str, object]:
        """Read the summary of a mission's terrain: extent, layers, where the rover starts."""
        return handed(self._client.get_terrain(mission_id))

    def list_drafts(self, mission_id: Id, limit: Many = 200) -> Mapping[str, object]:
        """List drafts of a mission: open, accepted or rejected, by whom and why."""
        return self._all(self._client.list_drafts(mission_id), limit)

    def check_plan(
        self, plan_id: Id, runs: Annotated[int, Field(ge=10, le=1000)] = 200
    ) -> Mapping[str, object]:
        """Hold validator, futures and flight rules against a plan, as `outcrop plan ci` does."""
        from ground.campaigns.engines import HereEngine
        from ground.checks.check_plan import CheckOrder, check_plan
        from ground.checks.report import CHECKED

        plan = self._client.get_plan(plan_id)
        problem = self._client.get_problem(plan["problem_id"]) if plan["problem_id"] else None
        if problem is None:
            return handed({"computed": False})
        with TemporaryDirectory(prefix="outcrop-check-") as folder:
            crl, world = Path(folder) / "plan.crl", Path(folder) / "problem.json"
            crl.write_text(self._client.get_plan_crl(plan_id), encoding="utf-8")
            world.write_text(json.dumps(problem["document"]), encoding="utf-8")
            found = check_plan(CheckOrder(plan=crl, world=world, runs=runs, seed=1), HereEngine())
        return handed({"computed": True, "report": None if found is None else CHECKED.document(found)})

    # ---- drafting

    def draft_target(
        self,
        mission_id: Id,
        east_m: Metres,
        north_m: Metres,
        name: Name = "",
        notes: Words = "",
        why: Words = "",
    ) -> Mapping[str, object]:
        """Propose a target at a place of the site frame; a person takes it over or not."""
        target: dict[str, Any] = {"east_m": east_m, "north_m": north_m, "notes": notes}
        return self._draft(mission_id, why, target=target | ({"name": name} if name else {}))

    def draft_request(
        self,
        mission_id: Id,
        target_id: Id,
        instrument: Name,
        value: Number,
        window_s: Window | None = None,
        rationale: Words = "",
        why: Words = "",
    ) -> Mapping[str, object]:
        """Propose an observation of a target; `window_s` is the earliest and latest start, plan seconds."""
        request: dict[str, Any] = {
            "target_id": target_id,
            "instrument": instrument,
            "value": value,
            "rationale": rationale,
        }
        return self._draft(mission_id, why, request=request | ({"window_s": window_s} if window_s else {}))

    def draft_keep_out(
        self, mission_id: Id, polygon_m: Corners, notes: Words = "", why: Words = ""
    ) -> Mapping[str, object]:
        """Propose a polygon (east, north) that the rover must not enter."""
        return self._draft(mission_id, why, keep_out={"polygon_m": polygon_m, "notes": notes})

    def draft_plan(
        self,
        mission_id: Id,
        max_branches: Annotated[int, Field(ge=0, le=64)] = 8,
        seed: Annotated[int, Field(ge=0, le=2**53 - 1)] = 1,
        strategy: Literal["optimal", "pico2005"] = "optimal",
        why: Words = "",
    ) -> Mapping[str, object]:
        """Propose to ask the planner for a plan; nothing is computed until a person takes it over."""
        order = {"max_branches": max_branches, "seed": seed, "strategy": strategy}
        return self._draft(mission_id, why, plan=order)

    def preview_sentence(self, mission_id: Id, text: Words) -> Mapping[str, object]:
        """Say what a plain sentence would draft, or what has to be asked."""
        return handed(self._client.read_sentence(mission_id, text=text))

    def draft_sentence(self, mission_id: Id, text: Words) -> Mapping[str, object]:
        """Draft what a plain sentence asks for."""
        return handed(self._client.draft_sentence(mission_id, text=text))

    # ----

    def _draft(self, mission_id: str, why: str, **form: Document) -> Document:
        made: Any = self._client.create_draft(mission_id, note=why, **form)
        return handed(made)

    def _all(self, items: Any, limit: int) -> Document:
        return handed(list(islice(items, limit)))

    def named(self) -> dict[str, Callable[..., Document]]:
        """Return the tools by name."""
        return {name: getattr(self, name) for name in (*READING, *DRAFTING)}


READING = (
    "list_missions",
    "list_targets",
    "list_requests",
    "list_plans",
    "read_plan",
    "why_not",
    "list_runs",
    "read_terrain",
    "list_drafts",
    "check_plan",
    "preview_sentence",
)
DRAFTING = ("draft_target", "draft_request", "draft_keep_out", "draft_plan", "draft_sentence")
