"""Attackers who own the network, an author's key, old packages, one file of the ledger, or the clock.

A script is a sequence of moves drawn from a seed, against a rover alone: packages need no ground to be sent.
None of the attackers has the approver's key.
"""

from __future__ import annotations

import json
import random
from collections import Counter
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

from ground.uplink.keys import id_of, public_text, sign
from ground.uplink.ledger import COPY, LEDGER
from ground.uplink.package import Signature, json_text, manifest_text, write_package
from ground.uplink.training import Team, make_team, sign_package
from tests.adversary.oracle import ROLES, Rover
from tests.ground.signed import package_1, parts, small_world, unzipped, zipped

HONEST = "(plan :id honest :node (task :id w :action wait :parameters (duration_s = {0})))"
EVIL = "(plan :id evil :node (task :id w :action wait :parameters (duration_s = 666)))"


class Script:
    """One script of moves against one rover."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.rng, self.folder = random.Random(seed), folder
        self.team: Team = make_team(folder / "keys", training=False)
        self.rover = Rover(folder, self.team, small_world(folder))
        self.trust = self.team.trust.read_bytes()
        self.sent: list[bytes] = []
        self.counter = 0

    def play(self) -> Counter[str]:
        """Return what was found, by name."""
        self.honest()
        for _ in range(self.rng.randint(2, 5)):
            self.rng.choice(MOVES)(self)
        self.rover.count("scripts")
        return self.rover.found

    # ---- moves

    def honest(self) -> None:
        """Two people sign a plan, and it goes up."""
        self.counter += 1
        plan = HONEST.format(self.counter)
        content = parts(self.counter, plan)
        self.rover.honest(content[0].encode(), *ROLES)
        self.sent.append(sign_package(self.team, *content))
        self.start(self.sent[-1])

    def replay(self) -> None:
        """An old package comes once more, as it was or packed anew."""
        old = self.rng.choice(self.sent)
        self.start(self.rng.choice([old, zipped(unzipped(old))]))

    def at_once(self) -> None:
        """A new package is started several times at the same time."""
        self.counter += 1
        content = parts(self.counter, HONEST.format(self.counter))
        self.rover.honest(content[0].encode(), *ROLES)
        self.sent.append(sign_package(self.team, *content))
        self.rover.start_together(self.sent[-1], self.rng.randint(2, 4))

    def alter(self) -> None:
        """A package is changed on its way, with its digests made to fit or not."""
        files = unzipped(self.rng.choice(self.sent))
        name = self.rng.choice(sorted(files))
        if self.rng.random() < 0.5:
            manifest = json.loads(files["manifest.json"])
            more: dict[str, Any] = {"counter": 10**6, "expires_utc": "2999-01-01T00:00:00+00:00"}
            manifest |= {key: value for key, value in more.items() if self.rng.random() < 0.7}
            kept = {k: v for k, v in manifest.items() if k not in {"files", "format", "crl_sha256"}}
            files["plan.crl"] = parts(1, EVIL)[1].encode()
            text = manifest_text(kept, files["plan.crl"].decode(), files["landmarks.json"].decode())
            files["manifest.json"] = text.encode()
        else:
            place = self.rng.randrange(len(files[name]))
            changed = bytes([files[name][place] ^ (1 << self.rng.randrange(8))])
            files[name] = files[name][:place] + changed + files[name][place + 1 :]
        self.start(zipped(files))

    def cut(self) -> None:
        """Bytes of the zip are lost or changed."""
        whole = bytearray(self.rng.choice(self.sent))
        place = self.rng.randrange(len(whole))
        if self.rng.random() < 0.5:
            whole[place] ^= 1 << self.rng.randrange(8)
        self.start(bytes(whole if self.rng.random() < 0.5 else whole[:place]))

    def author_alone(self) -> None:
        """An author signs in every role, with the own key and with others of the same making."""
        manifest, crl, landmarks = parts(self.counter + 100, EVIL)
        keys = [self.team.author, Ed25519PrivateKey.generate()]
        signed = []
        for role in ("author", "verifier", "approver"):
            key = self.team.author if role != "approver" else self.rng.choice(keys)
            named = self.rng.choice([key, self.team.approver])
            signature = sign(key, "package/2", role, manifest.encode())
            signed.append(Signature(role, id_of(public_text(named)), signature))
        self.start(write_package(manifest, crl, landmarks, signed))

    def borrowed(self) -> None:
        """Signatures of one package are put on another, and into other roles."""
        given = json.loads(unzipped(self.rng.choice(self.sent))["signatures.json"])["signatures"]
        for one in given:
            if self.rng.random() < 0.3:
                one["role"] = self.rng.choice(["author", "verifier", "approver"])
        manifest, crl, landmarks = parts(self.counter + 100, EVIL)
        content = {"manifest.json": manifest, "plan.crl": crl, "landmarks.json": landmarks}
        files = {name: text.encode() for name, text in content.items()}
        self.start(zipped({**files, "signatures.json": json_text({"signatures": given}).encode()}))

    def downgrade(self) -> None:
        """A package in the old form, signed by the author or by anybody."""
        key = self.rng.choice([self.team.author, Ed25519PrivateKey.generate()])
        self.start(package_1(key, sequence=self.counter + 100, plan=EVIL))

    def other_trust(self) -> None:
        """The attacker's own trust file and people, complete and sound."""
        theirs = make_team(self.folder / f"theirs{self.rng.random()}", training=False)
        self.start(sign_package(theirs, *parts(self.counter + 100, EVIL)), theirs.trust)

    def harmed_trust(self) -> None:
        """A bit of the trust file is changed."""
        content = bytearray(self.trust)
        content[self.rng.randrange(len(content))] ^= 1 << self.rng.randrange(8)
        path = self.folder / "harmed.json"
        path.write_bytes(bytes(content))
        self.start(self.rng.choice(self.sent), path)

    def ledger(self) -> None:
        """Whatever may happen to one of the two files of the ledger; then an old package comes."""
        path = self.rover.world / self.rng.choice([LEDGER, COPY])
        whole = path.read_bytes() if path.exists() else b""
        place = self.rng.randrange(len(whole) + 1)
        left = self.rng.choice(
            [None, b"", whole[:place], whole + b"x", whole[:place] + b"\0" + whole[place + 1 :], whole * 2]
        )
        path.unlink(missing_ok=True)
        if left is not None:
            path.write_bytes(left)
        self.replay()

    def time(self) -> None:
        """The clock is set back or forth."""
        self.rover.clock += timedelta(days=self.rng.choice([-400, -5, -1, 1, 5, 400]))
        self.replay()

    def start(self, content: bytes, trust: Path | None = None) -> None:
        self.rover.start(content, trust, resume=self.rng.random() < 0.1)


MOVES: tuple[Callable[[Script], None], ...] = (
    Script.honest,
    Script.replay,
    Script.at_once,
    Script.alter,
    Script.cut,
    Script.author_alone,
    Script.borrowed,
    Script.downgrade,
    Script.other_trust,
    Script.harmed_trust,
    Script.ledger,
    Script.time,
)
