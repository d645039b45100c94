"""Read what a campaign says, also while it goes on."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ground.campaigns.causes import Causes
from ground.campaigns.folder import ORDER, RUNS, CampaignFolder
from ground.campaigns.report import report_page
from ground.campaigns.result import RESULTS
from ground.errors import StateError
from ground.gdr.repository import Repository
from ground.records.actor import Actor
from ground.records.get_resource import read_row
from ground.resources.campaigns.kind import CAMPAIGN
from ground.resources.campaigns.row import CampaignRow
from ground.resources.campaigns.value import FlownRun, FlownRuns
from ground.resources.campaigns.work import LIVE
from mission.codec import read_object

MOST_RUNS = 500


def read_result(repo: Repository, actor: Actor, campaign_id: str) -> Mapping[str, object]:
    """Return `campaign/1`; of a campaign that goes on or was stopped, what the runs so far say.

    Raises
    ------
    StateError
        If there are no runs yet.
    """
    row: CampaignRow = read_row(repo, actor, CAMPAIGN, campaign_id)
    if row.result is not None:
        return row.result
    path = repo.campaign_dir(campaign_id) / LIVE
    if not path.exists():
        raise StateError(f"campaign {campaign_id} is {row.state}; it has no runs yet")
    return read_object(path)


def read_runs(
    repo: Repository,
    actor: Actor,
    campaign_id: str,
    *,
    low: float | None,
    high: float | None,
    option: str | None,
    task: str | None,
    limit: int,
) -> FlownRuns:
    """Return runs with a utility of `low` to `high` that took an option, or in which a task failed.

    Raises
    ------
    StateError
        If the campaign has a result and its runs are not here.
    """
    held = read_row(repo, actor, CAMPAIGN, campaign_id)
    folder = CampaignFolder(repo.campaign_dir(campaign_id))
    if not (folder.path / ORDER).exists():
        if held.result is not None:
            raise _gone(held)
        return FlownRuns([], 0)
    causes = Causes.of(folder.order().case().plan())
    items: list[FlownRun] = []
    total = 0
    for row in folder.rows(runs=None if held.result is None else int(held.result["runs"])):
        if (low is not None and row.utility < low) or (high is not None and row.utility > high):
            continue
        if (option is not None and option not in row.options) or (
            task is not None and task not in row.reasons
        ):
            continue
        total += 1
        if len(items) < min(limit, MOST_RUNS):
            items.append(
                FlownRun(
                    row.seed,
                    row.utility,
                    row.outcome,
                    row.end_s,
                    row.energy_used_j,
                    list(row.options),
                    causes.why(row),
                )
            )
    return FlownRuns(items, total)


def read_csv(repo: Repository, actor: Actor, campaign_id: str) -> Path:
    """Return the path of `runs.csv`.

    Raises
    ------
    StateError
        Until the campaign has ended, and when its runs are not here.
    """
    row: CampaignRow = read_row(repo, actor, CAMPAIGN, campaign_id)
    path = repo.campaign_dir(campaign_id) / RUNS
    if row.result is not None and not path.is_file():
        raise _gone(row)
    if row.result is None:
        raise StateError(f"campaign {campaign_id} is {row.state}; its table is there when it has ended")
    return path


def report_campaign(repo: Repository, actor: Actor, campaign_id: str) -> str:
    """Return the campaign as one page of HTML; raises as `read_result`."""
    document: Any = read_result(repo, actor, campaign_id)
    row, folder = read_row(repo, actor, CAMPAIGN, campaign_id), CampaignFolder(repo.campaign_dir(campaign_id))
    if not (folder.path / ORDER).is_file():
        raise _gone(row)
    return report_page(folder, RESULTS.from_document(document))


def _gone(row: CampaignRow) -> StateError:
    """Return the sentence for a campaign of which only the result is here."""
    why = "it came in with an archive" if row.elsewhere else "its folder is gone"
    return StateError(f"the runs of campaign {row.id} are not here: {why}; its result is")
