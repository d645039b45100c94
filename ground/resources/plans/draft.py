"""The best plan so far of a search that goes on: a file, for whoever watches."""

from __future__ import annotations

import math
import time
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import orjson
from sqlalchemy import select

from ground.gdr.base import utc_now
from ground.gdr.repository import Repository
from ground.resources.path_networks.geometry import network_geometry
from ground.resources.plans.row import PlanRow

if TYPE_CHECKING:
    from ground.day.prepare import PreparedDay
    from planner.plan_result import Progress
    from planner.plan_tree import Plan

FORM = "plan-draft/1"
DRAFT = ".plan-draft.json"
AT_MOST = 9.0
"""Drawing takes a tenth of the time: the search first goes on so many times as long as the last one took."""

LONGEST_WAIT_S = 0.05
"""But no longer than so: a better plan is to be on the page 0.3 s after it is found."""


def draft_of(repo: Repository, plan_id: str) -> Path:
    """Return the file in which the best plan so far is kept while a plan is made."""
    return repo.job_dir() / f"{plan_id}{DRAFT}"


def stray_drafts(repo: Repository) -> list[Path]:
    """Return the files of plans that are not being made: of a mission that was deleted meanwhile."""
    with repo.database.read() as session:
        making = set(session.scalars(select(PlanRow.id).where(PlanRow.crl_text.is_(None))))
    found = sorted(repo.job_dir().glob(f"*{DRAFT}"))
    return [path for path in found if path.name.removesuffix(DRAFT) not in making]


class Drawing:
    """Writes each better plan into a file; without a path, nothing.

    One that is found too soon after another one waits, and is written when `catch_up` is called next.
    """

    def __init__(self, path: str, day: PreparedDay) -> None:
        self._path, self._day = path, day
        self._drawn: Plan | None = None
        self._value = -math.inf
        self._network = network_geometry(day) if path else {}
        self._number = 0
        self._not_before = 0.0
        self._waiting: tuple[Progress, datetime] | None = None

    def show(self, progress: Progress) -> None:
        """Take up what the planner tells, if it tells of another plan that is not worth less."""
        if not self._path or not progress.plan or progress.plan == self._drawn:
            return
        best = self._value if self._waiting is None else self._waiting[0].value or 0.0
        if (progress.value or 0.0) < best:
            return  # a part of the search that begins anew: what is drawn stays the best
        self._waiting = (progress, utc_now())
        self.catch_up()

    def catch_up(self) -> None:
        """Write the plan that waits, if one does and enough time has passed since the last one."""
        from planner.notes import sketch
        from planner.plan_tree import plan_tree_to_dict

        began = time.monotonic()
        if self._waiting is None or began < self._not_before:
            return
        (progress, found_utc), self._waiting = self._waiting, None
        plan, value = progress.plan, progress.value or 0.0
        assert plan is not None
        self._drawn, self._value = plan, value
        self._number += 1
        problem = self._day.problem
        document = {
            "format": FORM,
            "number": self._number,
            "found_utc": found_utc,
            "value": value,
            "upper": progress.upper if progress.upper is not None and math.isfinite(progress.upper) else None,
            "branches": progress.branches,
            "tree": plan_tree_to_dict(sketch(problem, plan), problem),
            "network": self._network,
        }
        target = Path(self._path)
        fresh = target.with_name(f".{target.name}")
        with suppress(OSError):  # a full disk takes nothing from the plan itself
            fresh.write_bytes(orjson.dumps(document))
            fresh.replace(target)
        took_s = time.monotonic() - began
        self._not_before = time.monotonic() + min(LONGEST_WAIT_S, AT_MOST * took_s)
