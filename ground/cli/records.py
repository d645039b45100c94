"""`outcrop KIND list|show|set|delete|lineage`, the same for every kind of resource; and `outcrop api`."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from ground.cli.failure import fail
from ground.cli.resources import PERSON, SERVER, connected, group_of


@dataclass(frozen=True, slots=True)
class Group:
    """A group of commands for one kind of resource: its collection, and which of the verbs it has."""

    name: str
    about: str
    collection: str
    verbs: tuple[str, ...]
    columns: tuple[str, ...] = ()
    """Members that `list` shows after the id."""


GROUPS = (
    Group("mission", "Missions.", "missions", ("show", "set", "delete")),
    Group("sol", "Sols.", "sols", ("list", "add", "show", "set", "delete"), ("number", "battery_j", "notes")),
    Group("target", "Targets.", "targets", ("show", "set", "lineage")),
    Group("request", "Observation requests.", "observation-requests", ("show", "set", "lineage")),
    Group("keep-out", "Keep-outs.", "keep-outs", ("list", "show", "set"), ("name", "notes")),
    Group(
        "comment",
        "Comments.",
        "comments",
        ("list", "add", "show", "set", "delete"),
        ("author", "subject_kind", "subject_id", "text"),
    ),
    Group(
        "review",
        "Plans: look at, compare, approve.",
        "plans",
        ("list", "show", "set", "delete"),
        ("number", "state", "expected_utility", "author", "name"),
    ),
    Group(
        "run",
        "Runs.",
        "runs",
        ("list", "show", "set"),
        ("kind", "rover", "state", "outcome", "utility"),
    ),
    Group("network", "Path networks.", "path-networks", ("list", "show"), ("computed", "stale")),
    Group("frame", "Frames.", "frames", ("list", "add", "show", "set"), ("name", "counter", "level")),
    Group("solution", "Solutions.", "solutions", ("list", "show", "set"), ("label", "in_use", "added_utc")),
    Group("site-map", "Maps.", "site-maps", ("list", "show", "set", "delete"), ("name", "file_name")),
    Group("traverse", "Traverses.", "traverses", ("list", "show", "set", "delete"), ("name",)),
    Group("problem", "Planning problems.", "problems", ("list", "show"), ("sha256",)),
    Group("product", "Data products.", "products", ("show", "lineage")),
    Group("job", "Jobs.", "jobs", ("list", "show"), ("kind", "state", "progress", "message")),
    Group("approval", "Approvals.", "approvals", ("list",), ("plan_id", "approver", "void")),
    Group("person", "People and their roles.", "people", ("list", "show", "set"), ("name", "role", "active")),
)


def members(words: list[str]) -> dict[str, Any]:
    """Return the members of a body: `name=value`, the value JSON or else taken as text."""
    body: dict[str, Any] = {}
    for word in words:
        name, sign, text = word.partition("=")
        if not sign or not re.fullmatch(r"[a-z][a-z0-9_]*", name):
            fail(f"{word!r}: give members as name=value, such as notes=dusty or value=12.5")
        try:
            body[name] = json.loads(text)
        except ValueError:
            body[name] = text
    return body


def show(value: Any) -> None:
    """Print a value as JSON."""
    typer.echo(json.dumps(value, indent=1, ensure_ascii=False))


def register(app: typer.Typer) -> None:
    for group in GROUPS:
        typed = group_of(app, group.name, group.about)
        for verb in group.verbs:
            _VERBS[verb](typed, group)
    _api(app)


def _list(typed: typer.Typer, group: Group) -> None:
    @typed.command("list", help="List them, one a line. Needs a server.")
    def list_them(
        mission: str = typer.Argument("" if group.name == "person" else ..., help="id of the mission"),
        where: list[str] = typer.Option([], "--where", help="name=value, as the interface filters"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        base = f"/{group.collection}" if not mission else f"/missions/{mission}/{group.collection}"
        cursor: str | None = None
        with connected(server, person) as client:
            while True:
                asked: dict[str, Any] = {**members(where), "limit": 200}
                if cursor is not None:
                    asked["cursor"] = cursor
                page = client.request("GET", base, params=asked).json()
                for item in page["items"]:
                    cells = [str(item.get(name, "")) for name in group.columns]
                    typer.echo("  ".join([item["id"], *cells]))
                cursor = page["next_cursor"]
                if cursor is None:
                    return


def _add(typed: typer.Typer, group: Group) -> None:
    @typed.command("add", help="Make one from its members, name=value. Needs a server.")
    def add(
        mission: str = typer.Argument(...),
        body: list[str] = typer.Argument(None, help="name=value; the interface's description lists them"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        with connected(server, person) as client:
            url = f"/missions/{mission}/{group.collection}"
            typer.echo(client.request("POST", url, json=members(body or [])).json()["id"])


def _show(typed: typer.Typer, group: Group) -> None:
    @typed.command("show", help="Print one as JSON. Needs a server.")
    def show_one(
        identifier: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON
    ) -> None:
        with connected(server, person) as client:
            show(client.request("GET", f"/{group.collection}/{identifier}").json())


def _set(typed: typer.Typer, group: Group) -> None:
    @typed.command("set", help="Change members, name=value. Needs a server.")
    def set_members(
        identifier: str = typer.Argument(...),
        changes: list[str] = typer.Argument(..., help="name=value, the value as JSON or text"),
        revision: int | None = typer.Option(
            None, help="change only this revision; default whatever stands there"
        ),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        headers = {"If-Match": "*" if revision is None else f'"{revision}"'}
        with connected(server, person) as client:
            url = f"/{group.collection}/{identifier}"
            changed = client.request("PATCH", url, json=members(changes), headers=headers).json()
            typer.echo(f"{identifier} revision {changed['revision']}")


def _delete(typed: typer.Typer, group: Group) -> None:
    @typed.command("delete", help="Delete one. Needs a server.")
    def delete(
        identifier: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON
    ) -> None:
        with connected(server, person) as client:
            client.request("DELETE", f"/{group.collection}/{identifier}", headers={"If-Match": "*"})


def _lineage(typed: typer.Typer, group: Group) -> None:
    @typed.command("lineage", help="Follow it to what it came from and what came of it. Needs a server.")
    def lineage(
        identifier: str = typer.Argument(...), server: str = SERVER, person: str | None = PERSON
    ) -> None:
        with connected(server, person) as client:
            show(client.request("GET", f"/{group.collection}/{identifier}/lineage").json())


_VERBS: Mapping[str, Callable[[typer.Typer, Group], None]] = {
    "list": _list,
    "add": _add,
    "show": _show,
    "set": _set,
    "delete": _delete,
    "lineage": _lineage,
}


def _api(app: typer.Typer) -> None:
    @app.command("api")
    def call_api(
        method: str = typer.Argument(..., help="GET, POST, PATCH or DELETE"),
        path: str = typer.Argument(..., help="such as /missions; see `outcrop openapi`"),
        body: str | None = typer.Option(None, "--json", help="body of the request"),
        out: Path | None = typer.Option(None, help="write the answer here"),
        server: str = SERVER,
        person: str | None = PERSON,
    ) -> None:
        """Ask the REST interface for anything. Needs a server."""
        headers = {"If-Match": "*"} if method.upper() in {"PATCH", "DELETE"} else {}
        try:
            document = None if body is None else json.loads(body)
        except ValueError as err:
            fail(f"--json is no JSON: {err}")
        with connected(server, person) as client:
            url = "/" + path.removeprefix("/api/v1").lstrip("/")
            answer = client.request(method.upper(), url, json=document, headers=headers)
        if out is not None:
            out.write_bytes(answer.content)
            typer.echo(f"{out}: {len(answer.content)} bytes")
        elif "json" in answer.headers.get("content-type", ""):
            show(answer.json())
        elif answer.content:
            typer.echo(answer.text)
