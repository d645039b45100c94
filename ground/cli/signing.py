"""`outcrop review approve|sign`, `outcrop keys register`: what people sign, with keys that no server sees."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from ground.cli.connection import PERSON, SERVER, connected
from ground.cli.failure import fail, refusals
from ground.cli.resources import group_of

if TYPE_CHECKING:
    from ground.client import Client
    from ground.uplink.signing_key import SigningKey

Role = Literal["author", "verifier", "approver"]
KEY = typer.Option(
    ..., "--key", envvar="OUTCROP_KEY", help="one's own private key, or the socket of `outcrop keys serve`"
)
READ = typer.Argument(..., help="digest of the text that was read: see `outcrop review show`")


def register(app: typer.Typer) -> None:
    """Add the commands."""
    group = group_of(app, "review")

    @group.command("approve")
    def approve(
        plan: str = typer.Argument(...),
        crl_sha256: str = READ,
        key: Path = KEY,
        note: str = typer.Option(""),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Approve a verified plan that somebody else made, with one's own key. Needs a server."""
        with connected(server, person) as client:
            _sign(client, plan, crl_sha256, key, ("approver",), note)

    @group.command("sign")
    def sign_as_author(
        plan: str = typer.Argument(...),
        crl_sha256: str = READ,
        key: Path = KEY,
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Sign a verified plan as its author, and as its verifier where one is both. Needs a server."""
        with connected(server, person) as client:
            _sign(client, plan, crl_sha256, key, ("author", "verifier"), "")


def register_key(client: Client, private: SigningKey) -> str:
    """Return the name of a key whose public half the server has then."""
    from ground.resources.people.signing_keys import FORM
    from ground.uplink.keys import id_of

    public, name = private.public_text(), _me(client)
    proof = private.sign(FORM, "owner", name.encode())
    client.create_signing_key(public=public, proof=proof)
    return id_of(public)


def _me(client: Client) -> str:
    person = client.get_session().person
    if person is None:
        fail("the server does not know who you are: give --as or OUTCROP_API_KEY")
    return str(person.name)


def _sign(client: Client, plan: str, crl_sha256: str, file: Path, roles: Sequence[Role], note: str) -> None:
    """Sign the manifest of a plan, after holding it against the plan that was read."""
    from ground.uplink.signing_key import open_key
    from ground.uplink.verify import PACKAGE

    with refusals():
        private = open_key(file)
    statement = client.make_statement(plan)
    manifest = json.loads(statement.manifest)
    text = client.get_plan_crl(plan, canonical=True)
    if {crl_sha256, manifest["crl_sha256"]} != {hashlib.sha256(text.encode()).hexdigest()}:
        fail(f"the text of plan {plan} is not the one that was read ({crl_sha256[:16]}...)")
    mine = _me(client)
    who: dict[Role, str] = {
        "author": manifest["author"],
        "verifier": manifest["verification"]["verifier"],
        "approver": mine,
    }
    wanted = [role for role in roles if who[role] == mine]
    if not wanted:
        fail(f"{mine} is neither author nor verifier of plan {plan}")
    name = register_key(client, private)
    for role in wanted:
        client.sign_plan(
            plan,
            role=role,
            sha256=statement.sha256,
            key=name,
            signature=private.sign(PACKAGE, role, statement.manifest.encode()),
            note=note,
        )
        typer.echo(f"{role} of package {statement.counter}: {mine}, key {name}")
