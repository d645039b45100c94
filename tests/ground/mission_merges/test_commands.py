"""`outcrop mission diff` and `merge` against a server."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx

from ground.gdr.repository import Repository
from tests.ground.conftest import yard
from tests.ground.test_cli_resources import program, run, server

FIXTURES = (program, run, server)


def test_the_commands_tell_the_difference_and_merge(
    run: Callable[..., str], server: str, sqlite_repo: Repository, terrain_folder: Path
) -> None:
    mission = yard(sqlite_repo, terrain_folder).id
    run("target", "add", mission, "east_m=2.0", "north_m=1.0", "name=Rock")
    copy = run("mission", "copy", mission, "name=What if")
    assert run("mission", "diff", mission, copy).strip() == "the missions do not differ"
    (ours,), (theirs,) = ([t["id"] for t in listed(server, m)] for m in (mission, copy))
    run("target", "set", ours, "notes=ours")
    run("target", "set", theirs, "notes=theirs", "feature_type=float")
    told = run("mission", "diff", mission, copy, code=1)
    assert f"both-changed:{ours}:notes  target Rock: was: (none); ours: ours; theirs: theirs" in told
    assert "theirs  changed  target Rock: feature_type: (none) -> float" in told
    assert "1 conflict; nothing was merged" in run("mission", "merge", copy, mission, code=1)
    choice = f"both-changed:{ours}:notes=theirs"
    assert "0 would be added, 1 would be changed" in run(
        "mission", "merge", copy, mission, "--choose", choice, "--preview"
    )
    assert listed(server, mission)[0]["notes"] == "ours"
    assert "0 added, 1 changed, 0 removed" in run("mission", "merge", copy, mission, "--choose", choice)
    (merged,) = listed(server, mission)
    assert (merged["notes"], merged["feature_type"]) == ("theirs", "float")
    run("mission", "merge", copy, mission, "--choose", "nonsense", code=2)


def listed(server: str, mission: str) -> list[Any]:
    found: list[Any] = httpx.get(f"{server}/api/v1/missions/{mission}/targets").json()["items"]
    return found
