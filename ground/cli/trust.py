"""`outcrop keys`, `outcrop trust`: keys of people, and the file that says whose signature counts for what."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from ground.cli.connection import PERSON, SERVER, connected
from ground.cli.failure import fail, refusals

if TYPE_CHECKING:
    from ground.uplink.trust import TrustDocument

ROOTS = typer.Option(..., "--root", help="private root key; repeat for as many as the root threshold asks")
DAYS = typer.Option(365, min=1, max=3650, help="how long this version is good for")


def register(app: typer.Typer) -> None:
    """Add the commands."""
    keys = typer.Typer(help="A person's own keys; no server ever has one.", no_args_is_help=True)
    app.add_typer(keys, name="keys")
    _keys(keys)
    trust = typer.Typer(help="Trust files: whose signature counts for what.", no_args_is_help=True)
    app.add_typer(trust, name="trust")
    _make(trust)
    _change(trust)
    _use(trust)


def _keys(group: typer.Typer) -> None:
    @group.command("make")
    def make(file: Path = typer.Argument(..., help="new file, readable by its owner alone")) -> None:
        """Make a key pair. Needs no server."""
        from ground.uplink.keys import id_of, make_key, public_text

        with refusals():
            public = public_text(make_key(file))
        typer.echo(f"key {id_of(public)} in {file}\npublic {public}")

    @group.command("show")
    def show(file: Path = typer.Argument(..., help="a private key")) -> None:
        """Print the name of a key and its public half. Needs no server."""
        from ground.uplink.keys import id_of, load_key, public_text

        with refusals():
            public = public_text(load_key(file))
        typer.echo(f"key {id_of(public)} in {file}\npublic {public}")

    @group.command("public")
    def public(
        file: Path = typer.Argument(..., help="a private key"),
        out: Path | None = typer.Option(None, help="file to write; default the terminal"),
    ) -> None:
        """Give out the public half of a key, base64. Needs no server."""
        from ground.uplink.keys import load_key, public_text

        with refusals():
            text = public_text(load_key(file))
            typer.echo(text) if out is None else out.write_text(text + "\n", encoding="ascii")

    @group.command("serve")
    def serve(
        file: Path = typer.Argument(..., help="a private key, which this process alone reads"),
        socket: Path = typer.Option(..., "--socket", help="socket to answer on, for its owner alone"),
        form: list[str] = typer.Option(
            ["package/2", "signing-key/1", "audit-head/1"],
            "--form",
            help="what may be signed: package/2, signing-key/1, audit-head/1, trust/1; repeatable",
        ),
        make: bool = typer.Option(False, "--make", help="make the key where there is none"),
    ) -> None:
        """Hold a key and sign over a Unix socket: give the socket as --key. Needs no server."""
        import signal

        from ground.uplink.keys import id_of, load_key, make_key, public_text
        from ground.uplink.signer import Signer

        with refusals():
            key = make_key(file) if make and not file.exists() else load_key(file)
            signer = Signer(key, socket, frozenset(form))
        signal.signal(signal.SIGTERM, lambda *_: signer.stop())
        public = public_text(key)
        typer.echo(f"key {id_of(public)} signs {', '.join(sorted(form))} at {socket}\npublic {public}")
        try:
            signer.serve()
        except KeyboardInterrupt:
            signer.stop()

    @group.command("register")
    def register_public(
        file: Path = typer.Argument(..., help="a private key; only its public half is sent"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Register the public half of a key under one's name. Needs a server."""
        from ground.cli.signing import register_key
        from ground.uplink.signing_key import open_key

        with refusals():
            private = open_key(file)
        with connected(server, person) as client:
            typer.echo(register_key(client, private))


def _make(group: typer.Typer) -> None:
    @group.command("init")
    def init(
        file: Path = typer.Argument(..., help="new trust file"),
        rover: str = typer.Option(..., help="name of the rover it is for"),
        person: list[str] = typer.Option(..., help="who has the root key; one for each --root"),
        root: list[Path] = ROOTS,
        mission: list[str] = typer.Option([], help="id of a mission whose packages it is for; default any"),
        training: bool = typer.Option(False, help="for training: only rovers commissioned with it accept it"),
        days: int = DAYS,
    ) -> None:
        """Make a trust file with its root keys and nobody else. Needs no server."""
        from ground.uplink.keys import load_key
        from ground.uplink.trust import new_trust, write_trust

        if file.exists():
            fail(f"{file} is there already")
        if len(person) != len(root):
            fail(f"{len(root)} root keys need as many --person, not {len(person)}")
        with refusals():
            roots = dict(zip(person, map(load_key, root), strict=True))
            life = timedelta(days=days)
            document = new_trust(rover, roots, missions=mission, training=training, life=life)
            file.write_bytes(write_trust(document, list(roots.values())))
        typer.echo(f"{file}: version 1 for {rover}")

    @group.command("show")
    def show(file: Path = typer.Argument(..., help="a trust file")) -> None:
        """Check a trust file and print who may sign what. Needs no server."""
        from ground.uplink.trust import checked, read_file

        with refusals():
            trust = checked(read_file(file, "the trust file"))
        about = f"{trust.rover}, version {trust.version}, good until {trust.expires_utc.isoformat()}"
        typer.echo(about + (", for training" if trust.training else ""))
        for role, rule in sorted(trust.roles.items()):
            named = ", ".join(f"{trust.keys[k]['person']} ({k})" for k in rule["keys"]) or "nobody"
            typer.echo(f"  {role:9} {rule['threshold']} of {named}")


def _change(group: typer.Typer) -> None:
    def change(
        file: Path,
        roots: list[Path],
        days: int,
        edit: Callable[[TrustDocument], None],
        root_new: Path | None = None,
    ) -> None:
        from ground.uplink.keys import load_key
        from ground.uplink.trust import change_trust, checked, read_file

        with refusals():
            signers = [load_key(path) for path in [*roots, *([] if root_new is None else [root_new])]]
            content = change_trust(read_file(file, "the trust file"), signers, edit, timedelta(days=days))
            draft = file.with_name(f".{file.name}.draft")
            draft.write_bytes(content)
            draft.replace(file)
            typer.echo(f"{file}: version {checked(content).version}")

    @group.command("add")
    def add(
        file: Path = typer.Argument(..., help="a trust file"),
        person: str = typer.Argument(..., help="name, as the ground knows it"),
        public: str = typer.Argument(..., help="public key: base64, or a file with it"),
        role: list[str] = typer.Option(..., help="author, verifier, approver, root or package/1; repeatable"),
        root: list[Path] = ROOTS,
        days: int = DAYS,
    ) -> None:
        """Let a person's key count for roles. Needs no server."""
        from ground.uplink.keys import load_public
        from ground.uplink.trust import allow

        with refusals():
            text = load_public(public)
        change(file, root, days, lambda document: allow(document, person, text, role))

    @group.command("revoke")
    def revoke(
        file: Path = typer.Argument(..., help="a trust file"),
        key: str = typer.Argument(..., help="name of the key: see `outcrop trust show`"),
        root: list[Path] = ROOTS,
        days: int = DAYS,
    ) -> None:
        """Take a key out of every role. Needs no server."""
        from ground.uplink.trust import revoke as take_out

        change(file, root, days, lambda document: take_out(document, key))

    @group.command("threshold")
    def threshold(
        file: Path = typer.Argument(..., help="a trust file"),
        role: str = typer.Argument(..., help="a role"),
        people: int = typer.Argument(..., min=1, help="how many people have to sign"),
        root: list[Path] = ROOTS,
        days: int = DAYS,
    ) -> None:
        """Say how many people have to sign for a role. Needs no server."""
        from ground.uplink.trust import require

        change(file, root, days, lambda document: require(document, role, people))

    @group.command("rotate")
    def rotate(
        file: Path = typer.Argument(..., help="a trust file"),
        old: str = typer.Argument(..., help="name of the root key that goes"),
        new: Path = typer.Argument(..., help="private root key that comes"),
        person: str = typer.Option(..., help="who has the new root key"),
        root: list[Path] = ROOTS,
        days: int = DAYS,
    ) -> None:
        """Put one root key in the place of another; the old ones sign it, and the new. Needs no server."""
        from ground.uplink.keys import load_key, public_text
        from ground.uplink.trust import allow
        from ground.uplink.trust import revoke as take_out

        with refusals():
            public = public_text(load_key(new))

        def edit(document: TrustDocument) -> None:
            allow(document, person, public, ["root"])
            take_out(document, old)

        change(file, root, days, edit, new)


def _use(group: typer.Typer) -> None:
    @group.command("install")
    def install(
        file: Path = typer.Argument(..., help="a trust file"),
        world: Path = typer.Option(..., help="folder of the rover's world"),
    ) -> None:
        """Bind a rover to a trust file and its later versions, for good. Needs no server."""
        from ground.uplink.admission import commission

        with refusals():
            trust = commission(world, file)
        typer.echo(f"{world} trusts version {trust.version} of {trust.rover}")

    @group.command("check")
    def check(
        package: Path = typer.Argument(..., help="an uplink package"),
        trust: Path = typer.Option(..., help="a trust file"),
    ) -> None:
        """Check a package as a rover would, but for its ledger and dictionary. Needs no server."""
        from ground.uplink.trust import checked, read_file
        from ground.uplink.trust import refusals as of_verifier
        from ground.uplink.verify import verify_package

        with refusals(), of_verifier():
            known = checked(read_file(trust, "the trust file"))
            found = verify_package(read_file(package, "the package"), known, datetime.now(UTC))
        typer.echo(f"package {found.counter} of {found.mission}, plan {found.manifest['plan']}")
        for role, people in found.signers.items():
            typer.echo(f"  {role:9} {', '.join(people)}")
