"""Two people with a key each under a trust file: a whole uplink on one machine, by the real rules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from ground.durable import put_in_place
from ground.uplink.keys import id_of, load_key, make_key, public_text, sign
from ground.uplink.package import Signature, signing_keys, write_package
from ground.uplink.trust import TrustDocument, allow, change_trust, checked, new_trust, revoke, write_trust
from ground.uplink.verify import PACKAGE, PERSON, SIGNERS

TRUST_FILE, ROOT, AUTHOR, APPROVER = "trust.json", "root.key", "author.key", "approver.key"
PEOPLE = ("Planner", "Flight Director")
"""Who makes plans and who approves them: the profiles of a new repository."""


@dataclass(frozen=True, slots=True)
class Team:
    """The keys of an author, who verifies too, and an approver, and the trust file that names them."""

    author: Ed25519PrivateKey
    approver: Ed25519PrivateKey
    trust: Path


def make_team(folder: Path, *, rover: str = "training", training: bool = True) -> Team:
    """Return a new team; keys and trust file are written into the folder.

    Raises
    ------
    ConflictError
        If there are keys in it already.
    """
    root, author, approver = (make_key(folder / name) for name in (ROOT, AUTHOR, APPROVER))
    document = new_trust(rover, {"Root": root}, training=training)
    allow(document, PEOPLE[0], public_text(author), ("author", "verifier"))
    allow(document, PEOPLE[1], public_text(approver), ("approver",))
    trust = folder / TRUST_FILE
    trust.write_bytes(write_trust(document, [root]))
    return Team(author, approver, trust)


def sign_package(team: Team, manifest: str, crl_text: str, landmarks: str) -> bytes:
    """Return a package that both people of a team signed."""
    keys = dict(zip(SIGNERS, (team.author, team.author, team.approver), strict=True))
    signatures = [
        Signature(role, id_of(public_text(key)), sign(key, PACKAGE, role, manifest.encode()))
        for role, key in keys.items()
    ]
    return write_package(manifest, crl_text, landmarks, signatures)


@dataclass(frozen=True, slots=True)
class TrainedSigner:
    """A person's public key (base64), and the roles in which a training rover takes its signatures."""

    person: str
    public: str
    roles: tuple[str, ...]


def training_trust(folder: Path, mission: str, people: Sequence[TrainedSigner]) -> Path:
    """Return the trust file of a mission's training rover, which takes the signatures of these people alone.

    It is marked for training: no rover but the one that is commissioned with it accepts it, and the root key
    beside it counts for nothing else. A change of the people is one more version of it. A person whose name
    no trust file holds is left out (`unfit` names them). Call it with the ledger of the rover held, as two
    callers at once would each write a version of their own.
    """
    people = [signer for signer in people if PERSON.fullmatch(signer.person)]
    place = folder / TRUST_FILE
    root = load_key(folder / ROOT) if (folder / ROOT).exists() else make_key(folder / ROOT)

    def enter(document: TrustDocument) -> None:
        for name in set(document["keys"]) - set(document["roles"]["root"]["keys"]):
            revoke(document, name)
        for signer in people:
            allow(document, signer.person, signer.public, signer.roles)

    if not place.exists():
        document = new_trust("training", {"Training": root}, missions=[mission], training=True)
        enter(document)
        _put(place, write_trust(document, [root]))
        return place
    earlier = place.read_bytes()
    trust = checked(earlier)
    held = {role: {(k, trust.keys[k]["person"]) for k in trust.roles[role]["keys"]} for role in SIGNERS}
    wanted = {role: {(id_of(p.public), p.person) for p in people if role in p.roles} for role in SIGNERS}
    if held != wanted or trust.expires_utc <= datetime.now(UTC):
        _put(place, change_trust(earlier, [root], enter))
    return place


def unfit(people: Sequence[TrainedSigner], package: bytes) -> list[str]:
    """Return who of these people signed a package under a name that no trust file holds."""
    odd = {id_of(p.public): p.person for p in people if not PERSON.fullmatch(p.person)}
    return sorted({odd[key] for key in signing_keys(package) if key in odd})


def _put(place: Path, content: bytes) -> None:
    draft = place.with_name(f".{place.name}.draft")
    draft.write_bytes(content)
    put_in_place(draft, place)  # the ledger is bound to it, and outlives a loss of power
