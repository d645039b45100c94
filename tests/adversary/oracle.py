"""A rover that is given packages, and what it may have done with them.

The oracle shares no code with the product's check: a package that ran has to carry, over exactly its content,
the signatures that two different honest people gave as author, verifier and approver, and no counter of a
mission may run twice.
"""

from __future__ import annotations

import base64
import hashlib
import io
import json
import threading
import zipfile
from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from executive.errors import ExecutiveError
from ground.errors import GroundError
from ground.uplink.execute import Place, execute_package
from ground.uplink.training import Team
from rover_iface.errors import RoverError

ROLES = ("author", "verifier", "approver")
BAD = (
    "unapproved",
    "altered",
    "twice",
    "tracebacks",
    "requests without an answer",
    "refusals of more than a line",
    "approved without a signature",
)


class Rover:
    """A rover with its ledger; `signed` holds which manifests the honest people signed, and as what."""

    def __init__(self, folder: Path, team: Team, world: Path) -> None:
        self.folder, self.team, self.world = folder, team, world
        self.signed: dict[bytes, set[str]] = {}
        self.executed: list[tuple[str, int]] = []
        self.found: Counter[str] = Counter()
        self.noted: list[str] = []
        self.clock = datetime.now(UTC)
        self._starts = 0
        self._lock = threading.Lock()

    def honest(self, manifest: bytes, *roles: str) -> None:
        """Remember that the honest people signed a manifest."""
        self.signed.setdefault(manifest, set()).update(roles)

    def start(self, content: bytes, trust: Path | None = None, *, resume: bool = False) -> None:
        """Let the rover have a package, and judge what it did."""
        with self._lock:
            self._starts += 1
            number = self._starts
        package, out = self.folder / f"package{number}.zip", self.folder / f"run{number}"
        package.write_bytes(content)
        self.count("packages")
        self.carry_out(package, trust or self.team.trust, out, resume=resume)
        self.judge(content, out)

    def carry_out(self, package: Path, trust: Path, out: Path, *, resume: bool) -> None:
        """Let the rover's program have a package, under a trust file; count what it should not say."""
        place = Place("abstract", self.world, trust, 1)
        try:
            execute_package(package, place, out, resume=resume, clock=lambda: self.clock)
        except (GroundError, RoverError, ExecutiveError) as refusal:
            if "\n" in str(refusal):
                self.count("refusals of more than a line", str(refusal))
        except Exception as err:  # noqa: BLE001 - whatever else would be a traceback is counted
            self.count("tracebacks", f"execute: {type(err).__name__}: {err}")

    def start_together(self, content: bytes, times: int) -> None:
        """Let several executions of one package begin at once."""
        threads = [threading.Thread(target=self.start, args=(content,)) for _ in range(times)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def judge(self, content: bytes, out: Path) -> None:
        """Check a package against what the honest people signed if a command of it left."""
        journal = out / "journal.jsonl"
        if not journal.exists() or '"k":"send"' not in journal.read_text(errors="replace"):
            return
        self.count("runs")
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
        head = files["manifest.json"]
        manifest: dict[str, Any] = json.loads(head)
        if not self._approved(head, files):
            self.count("unapproved", manifest.get("plan", ""))
        named = manifest.get("files", {})
        said = {name: hashlib.sha256(files.get(name, b"")).hexdigest() for name in named}
        if said != named or not {"plan.crl", "landmarks.json"} <= set(named):
            self.count("altered", manifest.get("plan", ""))
        begun = (str(manifest.get("mission")), int(manifest.get("counter", -1)))
        with self._lock:
            twice = begun in self.executed
            self.executed.append(begun)
        if twice:
            self.count("twice", str(begun))

    def _approved(self, head: bytes, files: dict[str, bytes]) -> bool:
        try:
            given = [(s["role"], s["signature"]) for s in json.loads(files["signatures.json"])["signatures"]]
        except (KeyError, TypeError, ValueError):
            return False
        keys = {"author": self.team.author, "verifier": self.team.author, "approver": self.team.approver}
        people = set()
        for role, key in keys.items():
            said = f"outcrop package/2 {role}\n".encode() + head
            # False ones may stand beside the true one: what counts is that it is there.
            if not any(_true(key, signature, said) for as_, signature in given if as_ == role):
                return False
            if role not in self.signed.get(head, set()):
                return False  # true, but nobody gave it
            people.add(key.public_key().public_bytes(Encoding.Raw, PublicFormat.Raw))
        return len(people) == 2

    def count(self, what: str, detail: str = "") -> None:
        """Count an event; bad ones keep what they were about."""
        with self._lock:
            self.found[what] += 1
            if what in BAD:
                self.noted.append(f"{what}: {detail[:400]}")


def _true(key: Ed25519PrivateKey, signature: Any, said: bytes) -> bool:
    try:
        key.public_key().verify(base64.b64decode(signature), said)
    except (InvalidSignature, TypeError, ValueError):
        return False
    return True
