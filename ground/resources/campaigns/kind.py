"""How campaigns are stored and shown."""

from __future__ import annotations

from ground.records.actor import Action
from ground.records.kind import Kind
from ground.resources.campaigns.bodies import CampaignCreate
from ground.resources.campaigns.row import CampaignRow
from ground.resources.campaigns.value import Campaign


def _figure(row: CampaignRow, name: str) -> float | None:
    found = None if row.result is None else row.result["utility"][name]
    return None if found is None else float(found)


def _over_budget(row: CampaignRow) -> float | None:
    shares = [] if row.result is None else row.result["frequencies"]
    return next((float(f["share"]) for f in shares if f["what"] == "over budget"), None)


CAMPAIGN = Kind(
    "campaign",
    "cmp",
    "campaigns",
    CampaignRow,
    Campaign,
    Action.PLAN,
    make=CampaignCreate,
    computed={
        "runs_done": lambda row: 0 if row.result is None else int(row.result["runs"]),
        "mean_utility": lambda row: _figure(row, "mean"),
        "standard_error": lambda row: _figure(row, "standard_error"),
        "over_budget": _over_budget,
    },
)
