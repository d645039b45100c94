"""Two people with a key each under a trust file: a whole uplink on one machine, by the real rules."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from ground.uplink.keys import id_of, load_key, make_key, public_text, sign
from ground.uplink.package import Signature, write_package
from ground.uplink.trust import allow, new_trust, write_trust
from ground.uplink.verify import PACKAGE, SIGNERS

TRUST_FILE, ROOT, AUTHOR, APPROVER = "trust.json", "root.key", "author.key", "approver.key"
PEOPLE = ("Planner", "Flight Director")
"""Who makes plans and who approves them: the profiles of a new repository."""


@dataclass(frozen=True, slots=True)
class Team:
    """The keys of an author, who verifies too, and an approver, and the trust file that names them."""

    author: Ed25519PrivateKey
    approver: Ed25519PrivateKey
    trust: Path


def make_team(
    folder: Path, *, rover: str = "training", people: tuple[str, str] = PEOPLE, training: bool = True
) -> Team:
    """Return a new team; keys and trust file are written into the folder.

    Raises
    ------
    ConflictError
        If there are keys in it already.
    """
    root, author, approver = (make_key(folder / name) for name in (ROOT, AUTHOR, APPROVER))
    document = new_trust(rover, {"Root": root}, training=training)
    allow(document, people[0], public_text(author), ("author", "verifier"))
    allow(document, people[1], public_text(approver), ("approver",))
    trust = folder / TRUST_FILE
    trust.write_bytes(write_trust(document, [root]))
    return Team(author, approver, trust)


def load_team(folder: Path) -> Team:
    """Return the team of a folder that `make_team` wrote."""
    return Team(load_key(folder / AUTHOR), load_key(folder / APPROVER), folder / TRUST_FILE)


def sign_package(team: Team, manifest: str, crl_text: str, landmarks: str) -> bytes:
    """Return a package that both people of a team signed."""
    keys = dict(zip(SIGNERS, (team.author, team.author, team.approver), strict=True))
    signatures = [
        Signature(role, id_of(public_text(key)), sign(key, PACKAGE, role, manifest.encode()))
        for role, key in keys.items()
    ]
    return write_package(manifest, crl_text, landmarks, signatures)
