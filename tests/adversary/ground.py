"""A ground system with one verified plan, made once; each script gets a copy of its own."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import httpx

from ground.gdr.migrate import migrate
from ground.gdr.repository import Repository, open_repository
from ground.resources.people.accounts import ensure_profiles
from ground.uplink.admission import commission
from ground.uplink.training import Team, make_team
from rover_iface.terrain import write_terrain
from tests.ground.approving import registered, signed_by_all, waived
from tests.ground.conftest import Api, open_api, settings_for, yard
from tests.ground.planning import file_requests, finished, planned
from tests.rover_iface.worlds import plane


@dataclass(frozen=True, slots=True)
class Ground:
    """Data folders before and after the honest signatures, the plan, the rover's world, the people's keys."""

    verified: Path
    approved: Path
    world: Path
    team: Team
    mission: str
    plan: str
    read_sha256: str
    """Digest of the text that the honest people read; they sign nothing else."""
    manifest: bytes
    """What they signed in `approved`."""


def make_ground(folder: Path) -> Ground:
    """Plan a day, run it dry, and let both people sign it."""
    terrain = folder / "plane"
    write_terrain(plane(0.01, 0.02, half=16.0), terrain)
    data, team = folder / "verified", make_team(folder / "keys", training=False)
    repo = open_repository(settings_for(data))
    migrate(repo.database)
    ensure_profiles(repo)
    with _service(repo) as api:
        mission = yard(repo, terrain)
        file_requests(api, mission)
        plan = planned(api, mission)
        order = {"plan_id": plan["id"], "seed": 4}
        finished(api, api.post(f"/missions/{mission.id}/runs", order, status=202))
        waived(api, plan["id"])
        registered(api, "Planner", team.author)
        registered(api, "Flight Director", team.approver)
        problem = api.get(f"/problems/{plan['problem_id']}")["document"]
    world = folder / "world"
    world.mkdir()
    here = str(repo.terrain_dir(mission.terrain_id))
    document = {"format": "world/1", "name": "yard", "terrain": here, "problem": problem}
    (world / "world.json").write_text(json.dumps(document))
    commission(world, team.trust)
    approved = folder / "approved"
    shutil.copytree(data, approved)
    with service(approved) as api:
        statement = signed_by_all(api, plan["id"], team)
    manifest = statement["manifest"].encode()
    return Ground(data, approved, world, team, mission.id, plan["id"], plan["crl_sha256"], manifest)


class Ask(Protocol):
    """A ground that takes requests; the attackers reach its repository, too."""

    repo: Repository

    def __call__(
        self, method: str, path: str, json: Any = None, *, who: str | None = None, **options: Any
    ) -> httpx.Response: ...


@contextmanager
def service(data: Path) -> Iterator[Api]:
    """Give the service over a data folder."""
    with _service(open_repository(settings_for(data))) as api:
        yield api


@contextmanager
def _service(repo: Repository) -> Iterator[Api]:
    opened = open_api(repo)
    try:
        yield next(opened)
    finally:
        next(opened, None)
        repo.database.dispose()
