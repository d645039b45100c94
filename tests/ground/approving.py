"""People with keys who sign over REST, as the browser and the command line do."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

import httpx
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from ground.resources.people.signing_keys import FORM
from ground.uplink.keys import id_of, load_key, public_text, sign
from ground.uplink.training import Team, make_team
from tests.ground.conftest import Api


def registered(api: Api, who: str, key: Ed25519PrivateKey, **options: Any) -> str:
    """Register the public half of a person's key; return its name."""
    body = {"public": public_text(key), "proof": sign(key, FORM, "owner", who.encode())}
    found: str = api.post("/signing-keys", body, who=who, **options)["id"]
    return found


def hand_in(
    api: Api, plan: str, role: str, who: str, key: Ed25519PrivateKey, *, note: str = "", **other: Any
) -> httpx.Response:
    """Sign what the server has of a plan, and hand the signature in."""
    made = api("POST", f"/plans/{plan}/statement", who=who)
    if made.status_code != 201:
        return made
    registered(api, who, key)
    body = {**signature_body(made.json(), role, key), "note": note, **other}
    return api("POST", f"/plans/{plan}/signatures", body, who=who)


def signature_body(statement: dict[str, Any], role: str, key: Ed25519PrivateKey) -> dict[str, Any]:
    """Sign a statement and return what is handed in."""
    return {
        "role": role,
        "sha256": statement["sha256"],
        "key": id_of(public_text(key)),
        "signature": sign(key, "package/2", role, statement["manifest"].encode()),
    }


def waived(api: Api, plan: str) -> None:
    """Let the flight director waive every rule that does not hold."""
    for rule in api.get(f"/plans/{plan}/flight-rules"):
        if not rule["holds"] and not rule["waived_by"]:
            reason = {"rule": rule["rule"], "reason": "accepted for this test"}
            answer = api("POST", f"/plans/{plan}/waivers", reason, who="Flight Director")
            assert answer.status_code == 201, answer.text


def team_of(folder: Path) -> Team:
    """Return the team of a folder, made when there is none."""
    if not (folder / "author.key").exists():
        return make_team(folder, training=False)
    return Team(load_key(folder / "author.key"), load_key(folder / "approver.key"), folder / "trust.json")


def signed_by_all(api: Api, plan: str, team: Team, *, approver: str = "Flight Director") -> dict[str, Any]:
    """Let Planner sign as author and verifier and somebody approve; return the statement."""
    waived(api, plan)
    for role, who, key in (
        ("author", "Planner", team.author),
        ("verifier", "Planner", team.author),
        ("approver", approver, team.approver),
    ):
        answer = hand_in(api, plan, role, who, key)
        assert answer.status_code == 201, answer.text
    statement: dict[str, Any] = answer.json()
    return statement


def forged(length: int = 64) -> str:
    """Return something that looks like a signature."""
    return base64.b64encode(bytes(length)).decode()
