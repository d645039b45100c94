"""Attackers who own an account, the database, the files, the network or the clock of the ground.

A script acts over REST as any role, by archives, by SQL, by files and by commands; whatever package it
gets out of the ground, or makes of what it saw, goes to a rover. The honest planner and flight director sign
what they read, and nothing else, whenever they are asked.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
import random
import shutil
import threading
import traceback
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from datetime import UTC, datetime, timedelta, tzinfo
from pathlib import Path
from typing import Any
from unittest.mock import patch

import httpx
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from sqlalchemy import inspect, text
from sqlalchemy.exc import IntegrityError
from typer.testing import CliRunner

from executive.crl import canonical_text, digest, parse
from ground.cli.main import app, register_all
from ground.gdr.history import GENESIS
from ground.resources.people.signing_keys import FORM
from ground.uplink.keys import id_of, public_text, sign
from ground.uplink.package import json_text, manifest_text
from ground.uplink.training import make_team
from tests.adversary.ground import Ask, Ground, service
from tests.adversary.oracle import ROLES, Rover
from tests.ground.signed import unzipped, zipped

PEOPLE = ("Planner", "Scientist", "Flight Director", "Operator", "Viewer", "Administrator")
MAY_APPROVE = {"Flight Director", "Administrator"}
EVIL = canonical_text(parse("(plan :id evil :node (task :id go :action safemode))"))
UPLINK_TABLES = (
    "plans",
    "statements",
    "signatures",
    "signing_keys",
    "approvals",
    "packages",
    "runs",
    "people",
)
DAMAGED = "urn:outcrop:problem:data-damaged"
"""What the server says of rows that were changed behind it; an account alone never brings it to that."""
JUNK: tuple[Any, ...] = (None, 0, -1, 10**12, "", "x", "[]", "{}", "null", "approved", "verified", "9" * 400)


class Script:
    """One script of moves against a ground and its rover."""

    def __init__(self, folder: Path, seed: int, ground: Ground) -> None:
        self.rng, self.folder, self.ground = random.Random(seed), folder, ground
        self.signed = self.rng.random() < 0.6
        shutil.copytree(ground.approved if self.signed else ground.verified, folder / "data")
        world = folder / "world"
        shutil.copytree(ground.world, world)
        self.rover = self.make_rover(world)
        if self.signed:
            self.rover.honest(ground.manifest, *ROLES)
        self.own = Ed25519PrivateKey.generate()
        self.sent: list[tuple[str, str, Any, str, dict[str, str]]] = []
        self.got: list[bytes] = []
        self.beyond_accounts = self.signed
        """Whether the database was touched, or an approval is right: the server's word is not judged then."""
        self.harmed = False
        """Whether rows or files were changed behind the server: it may then say that they are damaged."""
        self.moves: list[str] = []
        self.api: Ask

    def play(self) -> Rover:
        """Return the rover with what was found."""
        with self.serve() as self.api, contextlib.ExitStack() as self.spells:
            for _ in range(self.rng.randint(2, 6)):
                move = self.rng.choice(self.moves_to_draw)
                self.moves.append(move.__name__)
                move(self)
            if self.rng.random() < 0.5:
                self.honest_signatures()
            self.honest_uplink()
            self.server_word()
        self.rover.count("scripts")
        return self.rover

    # ---- how it reaches the ground and the rover

    @property
    def moves_to_draw(self) -> Sequence[Callable[[Script], None]]:
        return MOVES

    def make_rover(self, world: Path) -> Rover:
        return Rover(self.folder, self.ground.team, world)

    def serve(self) -> AbstractContextManager[Ask]:
        """Open the ground over the script's data folder."""
        return service(self.folder / "data")

    def ask(self, method: str, path: str, body: Any = None, *, who: str, **options: Any) -> httpx.Response:
        """Send a request; a 5xx is a traceback that a proxy hid, unless it names the damage that was done."""
        self.sent.append((method, path, body, who, dict(options.get("headers", {}))))
        answer = self.api(method, path, body, who=who, **options)
        named = answer.status_code == 503 and answer.json()["type"] == DAMAGED and self.harmed
        if answer.status_code >= 500 and not named:
            self.rover.count("tracebacks", f"{method} {path} as {who} after {self.moves}: {answer.text}")
        return answer

    def url(self, rest: str = "") -> str:
        return f"/plans/{self.ground.plan}{rest}"

    def fetch(self, who: str, key: str = "") -> None:
        """Ask for the package, and send to the rover what comes."""
        headers = {"Idempotency-Key": key} if key else {}
        answer = self.ask("POST", self.url("/package"), who=who, headers=headers)
        if answer.status_code == 200:
            self.rover.count("packages made")
            self.got.append(answer.content)
            self.rover.start(answer.content)

    def statement(self, who: str) -> dict[str, Any] | None:
        answer = self.ask("POST", self.url("/statement"), who=who)
        return answer.json() if answer.status_code == 201 else None

    def give(self, role: str, who: str, key: Ed25519PrivateKey, said: dict[str, Any], signature: str) -> None:
        body = {
            "role": role,
            "sha256": said["sha256"],
            "key": id_of(public_text(key)),
            "signature": signature,
        }
        answer = self.ask("POST", self.url("/signatures"), body, who=who)
        if answer.status_code == 201 and role == "approver" and who in MAY_APPROVE:
            self.beyond_accounts = True

    def sql(self, statement: str, **values: Any) -> None:
        self.beyond_accounts = self.harmed = True
        with contextlib.suppress(IntegrityError), self.api.repo.database.engine.begin() as connection:
            connection.execute(text(statement), values)

    def rows(self, query: str, **values: Any) -> list[Any]:
        with self.api.repo.database.engine.connect() as connection:
            return list(connection.execute(text(query), values))

    def anybody(self) -> str:
        return self.rng.choice(PEOPLE)

    # ---- honest people

    def honest_signatures(self) -> None:
        """Planner and Flight Director sign what they read, if that is what they are shown."""
        said = self.statement("Planner")
        if said is None:
            return
        manifest = said["manifest"].encode()
        with contextlib.suppress(ValueError, KeyError, TypeError, AttributeError):
            if json.loads(manifest)["crl_sha256"] != self.ground.read_sha256:
                return
            team = self.ground.team
            people = (("author", "Planner"), ("verifier", "Planner"), ("approver", "Flight Director"))
            for role, who in people:
                key = team.author if who == "Planner" else team.approver
                self.rover.honest(manifest, role)
                self.give(role, who, key, said, sign(key, "package/2", role, manifest))

    def honest_uplink(self) -> None:
        """Operator asks for the package twice and starts it, more than once at a time now and then."""
        self.fetch("Operator")
        self.fetch("Operator")
        if self.got and self.rng.random() < 0.3:
            self.rover.start_together(self.got[-1], 3)

    def server_word(self) -> None:
        """Hold the server's word to the signatures, unless somebody had more than accounts."""
        state = self.ask("GET", self.url(), who="Viewer")
        if state.status_code != 200 or self.beyond_accounts:
            return
        if state.json()["state"] in {"approved", "uplinked", "executed"}:
            self.rover.count("approved without a signature", str(self.moves))

    # ---- an account

    def false_signature(self) -> None:
        """A signature of one's own, of nothing, or of another role, in any role as anybody."""
        who, role = self.anybody(), self.rng.choice(ROLES)
        said = self.statement(self.rng.choice(["Planner", who]))
        if said is None:
            return
        manifest = said["manifest"].encode()
        proof = sign(self.own, FORM, "owner", who.encode())
        self.ask("POST", "/signing-keys", {"public": public_text(self.own), "proof": proof}, who=who)
        made = sign(self.own, "package/2", self.rng.choice([role, "author"]), manifest)
        given = [s["signature"] for s in said["signatures"]]
        signature = self.rng.choice([made, *given, base64.b64encode(bytes(64)).decode(), "x", ""])
        key = self.rng.choice([self.own, self.ground.team.author, self.ground.team.approver])
        self.give(role, who, self.rng.choice([key, self.own]), said, signature)

    def taken_key(self) -> None:
        """Somebody registers another's public key as their own, with a proof that is another's or none."""
        key = self.rng.choice([self.ground.team.author, self.ground.team.approver])
        proofs = [
            sign(self.own, FORM, "owner", b"Planner"),
            sign(key, FORM, "owner", b"Planner"),
            "",
            "x" * 88,
        ]
        body = {"public": public_text(key), "proof": self.rng.choice(proofs)}
        self.ask("POST", "/signing-keys", body, who=self.anybody())
        if self.rng.random() < 0.3:
            self.ask("DELETE", f"/signing-keys/{id_of(public_text(key))}", who=self.anybody())

    def pushed_state(self) -> None:
        """Members that nobody may set are set: state, text, approver, role."""
        who = self.anybody()
        members = {
            "state": "approved",
            "crl_text": EVIL,
            "crl_sha256": digest(parse(EVIL)),
            "approved_by": "Flight Director",
            "author": "Nobody",
            "name": "n",
        }
        chosen = dict(self.rng.sample(sorted(members.items()), self.rng.randint(1, 4)))
        self.ask("PATCH", self.url(), chosen, who=who, headers={"If-Match": "*"})
        rule = {"rule": self.rng.choice(["FR-CAMPAIGN", "FR-ENERGY", "x"]), "reason": "because"}
        self.ask("POST", self.url("/waivers"), rule, who=who)
        (own,) = self.rows("SELECT id FROM people WHERE name = :name", name=who)[:1] or [("psn-0",)]
        self.ask(
            "PATCH", f"/people/{own[0]}", {"role": "flight_director"}, who=who, headers={"If-Match": "*"}
        )

    def edit(self) -> None:
        """The mission is edited under a plan, and the edit is taken back or not."""
        who, mission = self.rng.choice(["Planner", "Scientist", self.anybody()]), self.ground.mission
        for path in ("targets", "observation-requests", "sols", "keep-outs"):
            if self.rng.random() < 0.5:
                continue
            page = self.ask("GET", f"/missions/{mission}/{path}", who=who)
            items = page.json().get("items", []) if page.status_code == 200 else []
            for item in items[:1]:
                change = {"targets": {"name": "Other"}, "observation-requests": {"value": 30.0}}.get(path, {})
                self.ask("PATCH", f"/{path}/{item['id']}", change, who=who, headers={"If-Match": "*"})
                if self.rng.random() < 0.2:
                    self.ask("DELETE", f"/{path}/{item['id']}", who=who, headers={"If-Match": "*"})
        if self.rng.random() < 0.5:
            self.ask("POST", f"/missions/{mission}/undo", {}, who=who)

    def asked_at_once(self) -> None:
        """The package is asked for several times at the same time, under one key or several."""
        who, one = self.rng.choice(["Operator", self.anybody()]), self.rng.random() < 0.5
        keys = [f"k{0 if one else n}" for n in range(3)]
        threads = [threading.Thread(target=self.fetch, args=(who, key)) for key in keys]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()

    def nonsense(self) -> None:
        """Bodies of the wrong shape go to what leads to an approval."""
        said = {"role": "approver", "sha256": "0" * 64, "key": "0" * 16, "signature": "x" * 88}
        for name in self.rng.sample(sorted(said), 2):
            said[name] = self.rng.choice([*JUNK, [], {}, "\ud800", "\0", 1.5, True])
        path = self.rng.choice(
            [self.url("/signatures"), self.url("/waivers"), "/signing-keys", "/runs/ingest"]
        )
        content = json.dumps(self.rng.choice([said, [said], None, "x", {"upload_id": said["key"]}]))
        headers = {"Content-Type": "application/json"}
        self.ask("POST", path, who=self.anybody(), headers=headers, content=content.encode())

    # ---- an archive

    def archive(self) -> None:
        """The mission goes out, is forged, deleted and comes in again as somebody's."""
        whole = self.ask("GET", f"/missions/{self.ground.mission}/archive", who=self.anybody())
        if whole.status_code != 200:
            return
        files = unzipped(whole.content)
        rows = json.loads(files["rows.json"])
        for forge in self.rng.sample(FORGERIES, self.rng.randint(1, 3)):
            with contextlib.suppress(KeyError, IndexError, TypeError, ValueError):
                forge(self, rows)
        files["rows.json"] = json.dumps(rows).encode()
        manifest = json.loads(files["manifest.json"])
        manifest["files"]["rows.json"] = hashlib.sha256(files["rows.json"]).hexdigest()
        files["manifest.json"] = json.dumps(manifest).encode()
        self.ask("DELETE", f"/missions/{self.ground.mission}", who="Administrator", headers={"If-Match": "*"})
        who = self.rng.choice(["Planner", self.anybody()])
        sent = self.ask("POST", "/uploads?file_name=m.zip", who=who, content=zipped(files))
        if sent.status_code == 201:
            self.ask("POST", "/missions/import", {"upload_id": sent.json()["id"]}, who=who)

    def _forge_approval(self, rows: dict[str, Any]) -> None:
        row = rows["plans"][0]
        row |= {
            "state": self.rng.choice(["approved", "verified", "uplinked"]),
            "approved_by": "Flight Director",
        }
        stamp = {
            k: row[k] for k in ("created_utc", "modified_utc", "mission_id", "terrain_sha256", "crl_sha256")
        }
        others = {"dictionary_sha256": "0" * 64, "models_sha256": "0" * 64, "revision": 1, "note": ""}
        who = {"id": "apv-1", "plan_id": row["id"], "author": "Flight Director"}
        rows["approvals"] = [{**stamp, **others, **who}]

    def _forge_text(self, rows: dict[str, Any]) -> None:
        rows["plans"][0] |= {"crl_text": EVIL, "crl_sha256": digest(parse(EVIL))}
        for run in rows["runs"]:
            run["crl_sha256"] = digest(parse(EVIL))

    def _forge_people(self, rows: dict[str, Any]) -> None:
        for table in rows.values():
            for row in table if isinstance(table, list) else ():
                if "author" in row:
                    row["author"] = self.rng.choice(["Flight Director", "Nobody", "Planner"])

    def _forge_elsewhere(self, rows: dict[str, Any]) -> None:
        for run in rows["runs"]:
            run["elsewhere"] = False
        rows["elsewhere"] = []

    def _forge_history(self, rows: dict[str, Any]) -> None:
        rows["events"] = []
        rows["event_chains"][0] |= {"seq": 0, "sha256": GENESIS}

    def _forge_cell(self, rows: dict[str, Any]) -> None:
        table = self.rng.choice([t for t in rows.values() if t])
        row = self.rng.choice(table)
        row[self.rng.choice(sorted(row))] = self.rng.choice([*JUNK, [], {}, 1.5, True])

    # ---- the database

    def changed_cell(self) -> None:
        """Any cell of the tables that lead to a package gets junk, or another row's value."""
        table = self.rng.choice(UPLINK_TABLES)
        columns = [str(c["name"]) for c in inspect(self.api.repo.database.engine).get_columns(table)]
        column = self.rng.choice([c for c in columns if c != "id"])
        found = [row[0] for row in self.rows(f"SELECT {column} FROM {table}")]
        self.sql(f"UPDATE {table} SET {column} = :value", value=self.rng.choice([*JUNK, *found]))

    def changed_text(self) -> None:
        """The plan's text is another, with those digests made to fit that the attacker cares for."""
        plan, evil = self.ground.plan, digest(parse(EVIL))
        self.sql("UPDATE plans SET crl_text = :text WHERE id = :plan", text=EVIL, plan=plan)
        for statement in (
            "UPDATE plans SET crl_sha256 = :evil WHERE id = :plan",
            "UPDATE runs SET crl_sha256 = :evil WHERE plan_id = :plan",
            "UPDATE approvals SET crl_sha256 = :evil WHERE plan_id = :plan",
            "UPDATE plans SET state = 'approved' WHERE id = :plan",
        ):
            if self.rng.random() < 0.7:
                self.sql(statement, evil=evil, plan=plan)

    def changed_statement(self) -> None:
        """What was signed is rewritten: plan, counter, expiry; the signatures stay or are made anew."""
        for name, manifest, landmarks in self.rows("SELECT id, manifest, landmarks FROM statements"):
            try:
                said = json.loads(manifest)
            except (TypeError, ValueError):
                return
            if not isinstance(said, dict):  # junk of a move before
                return
            more = {"counter": 10**6, "expires_utc": "2999-01-01T00:00:00+00:00", "author": "Flight Director"}
            said |= dict(self.rng.sample(sorted(more.items()), self.rng.randint(0, 2)))
            kept = {k: v for k, v in said.items() if k not in {"files", "format", "crl_sha256"}}
            (crl,) = self.rows("SELECT crl_text FROM plans WHERE id = :plan", plan=self.ground.plan) or [
                ("",)
            ]
            new = manifest_text(kept, self.rng.choice([EVIL, crl[0] or ""]), landmarks or "")
            sha256 = hashlib.sha256(new.encode()).hexdigest()
            self.sql(
                "UPDATE statements SET manifest = :new, sha256 = :sha256 WHERE id = :name",
                new=new,
                sha256=sha256,
                name=name,
            )
            if self.rng.random() < 0.5:
                self._own_signatures(new.encode())

    def _own_signatures(self, manifest: bytes) -> None:
        """All signatures become the attacker's, under the people's names and keys."""
        self.sql("UPDATE signing_keys SET public = :public", public=public_text(self.own))
        for role in ROLES:
            made = sign(self.own, "package/2", role, manifest)
            self.sql("UPDATE signatures SET signature = :made WHERE role = :role", made=made, role=role)

    def written_approval(self) -> None:
        """Signatures and an approval that nobody gave are written, as copies of what is there."""
        for name, manifest in self.rows("SELECT id, manifest FROM statements"):
            for role in ROLES:
                made = sign(self.own, "package/2", role, str(manifest).encode())
                self.sql(
                    "INSERT INTO signatures (id, author, mission_id, statement_id, role, key_id, signature, "
                    "revision, created_utc, modified_utc) VALUES (:id, 'Flight Director', :mission, :name, "
                    ":role, :key, :made, 1, '2026-01-01 00:00:00', '2026-01-01 00:00:00')",
                    id=f"sgn-{role}",
                    mission=self.ground.mission,
                    name=name,
                    role=role,
                    key=id_of(public_text(self.rng.choice([self.own, self.ground.team.approver]))),
                    made=made,
                )
        self.sql("UPDATE plans SET state = 'approved', approved_by = 'Flight Director'")

    def swapped_roles(self) -> None:
        """Signatures are put into other roles, or under other keys and people."""
        self.sql("UPDATE signatures SET role = :role", role=self.rng.choice(ROLES))
        key = id_of(public_text(self.ground.team.author))
        if self.rng.random() < 0.5:
            self.sql("UPDATE signatures SET key_id = :key, author = 'Flight Director'", key=key)

    # ---- files, network, old packages, clock, command line

    def files(self) -> None:
        """A stored file is deleted, cut or changed; the fresh ones first, as a package is."""
        self.harmed = True
        stored = [p for p in (self.folder / "data" / "files").rglob("*") if p.is_file()]
        for path in self.rng.sample(stored, min(len(stored), self.rng.choice([1, 99]))):
            whole = path.read_bytes()
            path.chmod(0o600)
            if self.rng.random() < 0.4:
                path.unlink()
            elif self.rng.random() < 0.5 and self.got:
                path.write_bytes(self.evil_package(self.rng.choice(self.got)))
            else:
                path.write_bytes(whole[: len(whole) // 2] + b"x")

    def evil_package(self, of: bytes) -> bytes:
        """Return a package with another plan, digests that fit and the signatures of one that is right."""
        files = unzipped(of)
        manifest = json.loads(files["manifest.json"])
        manifest["counter"] = int(manifest.get("counter", 0)) + self.rng.randint(0, 5)
        kept = {k: v for k, v in manifest.items() if k not in {"files", "format", "crl_sha256"}}
        files["plan.crl"] = EVIL.encode()
        files["manifest.json"] = manifest_text(kept, EVIL, files["landmarks.json"].decode()).encode()
        return zipped(files)

    def intercepted(self) -> None:
        """A package is changed on its way to the rover, or comes again."""
        if not self.got:
            self.fetch("Operator")
        if self.got:
            old = self.rng.choice(self.got)
            self.rover.start(self.rng.choice([old, self.evil_package(old), zipped(unzipped(old))]))

    def harvested(self) -> None:
        """A package is put together from what the server shows: statement, text and signatures."""
        said = self.ask("GET", self.url("/statement"), who=self.anybody())
        shown = self.ask("GET", self.url("/crl?canonical=true"), who="Viewer")
        if said.status_code != 200 or said.json() is None or shown.status_code != 200:
            return
        signatures = [
            {"role": s["role"], "key": s["key"], "signature": s["signature"]}
            for s in said.json()["signatures"]
        ]
        (landmarks,) = self.rows("SELECT landmarks FROM statements")[:1] or [("{}",)]
        files = {
            "manifest.json": said.json()["manifest"].encode(),
            "plan.crl": self.rng.choice([shown.text, EVIL]).encode(),
            "landmarks.json": str(landmarks[0]).encode(),
            "signatures.json": json_text({"signatures": signatures}).encode(),
        }
        self.got.append(zipped(files))
        self.rover.start(self.got[-1])

    def replayed(self) -> None:
        """Requests that were seen are sent again, as they were or under one key with another body."""
        for method, path, body, who, headers in self.rng.sample(self.sent, min(4, len(self.sent))):
            sent = (
                {**headers, "Idempotency-Key": self.rng.choice(["a", "b"])} if method == "POST" else headers
            )
            self.ask(method, path, body, who=self.rng.choice([who, self.anybody()]), headers=sent)

    def server_clock(self) -> None:
        """The clock of the server is set forth or back."""
        shift = timedelta(days=self.rng.choice([-4000, -30, -3, 3, 30, 4000]))
        self.spells.enter_context(
            patch("ground.resources.packages.statement.datetime", _ClockOfTheServer(shift))
        )

    def rover_clock(self) -> None:
        """The clock of the rover is set forth or back."""
        self.rover.clock += timedelta(days=self.rng.choice([-400, -8, -1, 1, 8, 400]))

    def command_line(self) -> None:
        """Commands that need no server are run by somebody with a shell on the ground, or at the rover."""
        theirs = make_team(self.folder / f"theirs-{self.rng.random()}", training=self.rng.random() < 0.5)
        package, out = self.folder / "out.zip", self.folder / f"cli-{self.rng.random()}"
        content = self.evil_package(self.rng.choice(self.got)) if self.got else b"x"
        package.write_bytes(content)
        world, trust = str(self.rover.world), str(theirs.trust)
        self.run(["package", self.ground.plan, "--as", self.anybody(), "--out", str(self.folder / "cli.zip")])
        if (self.folder / "cli.zip").exists():
            self.got.append((self.folder / "cli.zip").read_bytes())
        self.run(["trust", "install", trust, "--world", world])
        used = str(self.rng.choice([self.ground.team.trust, theirs.trust]))
        self.run(["execute", str(package), "--world", world, "--trust", used, "--out", str(out)])
        self.rover.judge(content, out)
        self.run(["ingest", str(self.rng.choice([out, self.rover.world])), "--as", self.anybody()])

    def run(self, arguments: list[str]) -> None:
        """Run a command in this process; anything but an end with a status is a traceback."""
        with patch.dict(os.environ, OUTCROP_DATA_DIR=str(self.folder / "data"), OUTCROP_EXECUTOR="inline"):
            ended = _RUNNER.invoke(program(), arguments)
        if ended.exception is not None and not isinstance(ended.exception, SystemExit):
            lines = traceback.format_exception(ended.exception)
            self.rover.count("tracebacks", f"{arguments[:2]} after {self.moves}: {''.join(lines[-3:])}")


_RUNNER = CliRunner()


def program() -> Any:
    if not app.registered_commands:
        register_all()
    return app


class _ClockOfTheServer:
    """Stands for `datetime` where the server asks for the time."""

    def __init__(self, shift: timedelta) -> None:
        self.shift, self.fromisoformat = shift, datetime.fromisoformat

    def now(self, _zone: tzinfo) -> datetime:
        return datetime.now(UTC) + self.shift


FORGERIES: tuple[Callable[[Script, dict[str, Any]], None], ...] = (
    Script._forge_approval,
    Script._forge_text,
    Script._forge_people,
    Script._forge_elsewhere,
    Script._forge_history,
    Script._forge_cell,
)
MOVES: tuple[Callable[[Script], None], ...] = (
    Script.honest_signatures,
    Script.false_signature,
    Script.taken_key,
    Script.pushed_state,
    Script.edit,
    Script.asked_at_once,
    Script.nonsense,
    Script.archive,
    Script.changed_cell,
    Script.changed_text,
    Script.changed_statement,
    Script.written_approval,
    Script.swapped_roles,
    Script.files,
    Script.intercepted,
    Script.harvested,
    Script.replayed,
    Script.server_clock,
    Script.rover_clock,
    Script.command_line,
)
