"""`outcrop KIND ...`: a command for every operation of the interface, made from its description.

A command stands in the group of the resource whose path it asks: `list`, `add`, `show`, `set` and `delete`,
or the rest of the path (`GET /plans/{plan_id}/why-not/{request_id}` is `review why-not`). Variables of the
path and required members of the body are given by position, all others as options; any member of the body
can be given as name=value too. A command of the same name that another module registers comes first.
"""

from __future__ import annotations

import inspect
import json
import re
import string
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from typer.core import TyperGroup

from ground.cli.connection import PERSON, SERVER, connected, follow, show, uploaded, written
from ground.cli.failure import fail
from ground.cli.forms.at import CRS, LONLAT, LONLAT_HELP, at_of, reference_of
from ground.cli.help_text import first_paragraph

if TYPE_CHECKING:
    from ground.client.interface import Member, Operation

ABOUT = {
    "mission": "Missions.",
    "sol": "Sols.",
    "sol-path": "Sols planned together.",
    "target": "Targets.",
    "request": "Observation requests.",
    "keep-out": "Keep-outs.",
    "comment": "Comments.",
    "draft": "Proposals of assistants and sentences, taken over or rejected by people.",
    "review": "Plans: look at, compare, approve.",
    "run": "Runs.",
    "network": "Path networks.",
    "frame": "Sites, ends of drives and poses, and which solution of each is in use.",
    "solution": "Answers to where a frame lies; every one is kept.",
    "site-map": "Maps made at a site.",
    "traverse": "Stops adjusted together.",
    "problem": "Planning problems.",
    "product": "Data products.",
    "campaign": "One plan flown many times: what goes wrong, how often, and why.",
    "job": "Jobs.",
    "operations": "How the service fares.",
    "approval": "Approvals.",
    "person": "People and their roles.",
    "history": "Changes of a mission.",
    "exchange": "Files in and out.",
    "feature": "OGC API Features: what a GIS reads.",
    "api-key": "Keys for programs.",
    "webhook": "Servers elsewhere that are told of a mission's events.",
    "session": "Who one is, and where one is logged in.",
}
"""Groups in which there are commands by hand or a word about them; others come as the interface has them."""
KINDS = {"observation-requests": "request", "plans": "review", "path-networks": "network", "people": "person"}
"""Collections whose group has another name than their own in the singular."""
PLACES = {
    "say_presence": "mission say-presence",
    "leave_presence": "mission leave-presence",
    "undo": "history undo",
    "redo": "history redo",
    "list_history": "history list",
    "get_mission_as_of": "history as-of",
    "create_path_network": "network make",
    "compare_plans": "review compare",
    "differ_plans": "review diff",
    "check_crl": "review check",
    "edit_plan": "review edit",
    "create_waiver": "review waive",
    "make_statement": "review prepare",
    "export_geometry": "exchange export-geometry",
    "import_geometry": "exchange import-geometry",
    "get_features_landing_page": "feature root",
    "get_features_conformance": "feature conformance",
    "get_feature_collections": "feature collections",
    "get_feature_collection": "feature collection",
    "get_feature_queryables": "feature queryables",
    "get_features": "feature list",
    "get_feature": "feature show",
    "draw_plan": "exchange draw-plan",
    "export_products": "exchange products",
    "export_stac": "exchange stac",
    "export_pds4": "exchange pds4",
    "get_stac_catalog": "exchange stac-catalog",
    "get_stac_group": "exchange stac-group",
    "get_stac_item": "exchange stac-item",
    "get_stac_terrain": "exchange stac-terrain",
    "get_run_report": "exchange report",
    "list_frame_files": "frame files",
    "list_sessions": "session list",
    "list_api_keys": "api-key list",
    "import_frames": "frame import",
    "export_frames": "frame export",
    "get_traverse_picture": "traverse picture",
    "get_site_map_file": "site-map get",
    "get_operations": "operations show",
}
"""Commands whose name does not follow from the path."""
LINES = {
    "list_missions": "{id}  {name}  {counts[targets]} targets, {counts[observation_requests]} requests, "
    "{counts[plans]} plans, {counts[products]} products",
    "list_sols": "{id}  {number}  {battery_j}  {notes}",
    "list_targets": "{id}  {name}  {position[east_m]:.2f} {position[north_m]:.2f} {position[up_m]:.2f}",
    "create_target": "{id}  {name}  up {position[up_m]:.3f} m",
    "list_observation_requests": "{id}  {target_name}  {instrument}  value {value:g}  {state}  "
    "{state_reason}",
    "list_keep_outs": "{id}  {name}  {notes}",
    "list_comments": "{id}  {author}  {subject_kind}  {subject_id}  {text}",
    "list_drafts": "{id}  {state}  {kind}  drafted by {drafted_by} for {drafted_for}  {note}",
    "list_plans": "{id}  {number}  {state}  {expected_utility}  {author}  {name}",
    "list_runs": "{id}  {kind}  {rover}  {state}  {outcome}  {utility}",
    "list_path_networks": "{id}  {computed}  {stale}",
    "list_frames": "{id}  {name}  {counter}  {level}",
    "list_frame_files": "{id}  {file_name}  {added} new, {known} known",
    "import_frames": "{id}  {added} solutions, {known} known before",
    "list_solutions": "{id}  {label}  {in_use}  {added_utc}",
    "list_site_maps": "{id}  {name}  {file_name}",
    "list_problems": "{id}  {sha256}",
    "list_products": "{id}  {file_name}  request {request_id}  run {run_id}",
    "list_jobs": "{id}  {kind}  {state}  {progress}  {message}",
    "cancel_job": "{id} {state} {message}",
    "retry_job": "{id} {state} {message}",
    "list_approvals": "{id}  {plan_id}  {approver}  {void}",
    "list_signing_keys": "{id}  {person}  {public}  {revoked_utc}",
    "list_sessions": "{id}  {person}  {program}  until {expires_utc}  {current}",
    "list_api_keys": "{id}  {person}  {name}  {role}  {mission_ids}  until {expires_utc}",
    "list_people": "{id}  {name}  {role}  {active}",
    "list_history": "{seq:6}  {at_utc}  {actor}  {action}  {kind} {subject_id}  {reason}",
    "undo": "{action} {kind} {subject_id}",
    "redo": "{action} {kind} {subject_id}",
    "get_plan_findings": "{severity} {code} line {line}: {message}",
    "check_crl": "{severity} {code} line {line} column {column}: {message}",
    "import_geometry": "{targets:n} targets, {keep_outs:n} keep-outs",
    "list_traverses": "{id}  {name}",
    "create_api_key": "{id}  {secret}",
    "create_webhook": "{id}  {secret}",
    "rotate_webhook_secret": "{id}  {secret}",
    "list_webhooks": "{id}  {active}  {name}  {url}",
    "list_webhook_deliveries": "{event:6}  {at_utc}  {state}  {type}  {attempts} tries  {detail}",
}
"""What is printed of an answer, or of each of its items; else ids of a list, JSON of one thing."""
DEFAULTS: Mapping[str, Mapping[str, Any]] = {"list_history": {"newest_first": True, "limit": 50}}
BY_HAND = {
    "create_mission": "mission create",
    "create_keep_out": "keep-out add",
    "create_observation_request": "request add",
    "create_plan": "make-plan",
    "create_run": "dry-run",
    "control_run": "run control",
    "get_product_file": "product get",
    "get_flight_rules": "review rules",
    "sign_plan": "review approve",
    "create_signing_key": "keys register",
    "choose_solution": "frame use",
    "create_solution": "solution add",
    "differ_missions": "mission diff",
    "merge_missions": "mission merge",
    "create_traverse": "traverse adjust",
    "create_upload": "exchange import-geometry",
    "list_rovers": "rover list",
    "read_rover": "rover show",
    "read_sentence": "request say",
    "draft_sentence": "request say",
    "create_session": "api",
    "create_first_administrator": "api",
    "change_password": "session password",
    "reset_password": "person reset-password",
    "delete_session": "api",
}
"""Operations whose command is written by hand; a file is uploaded by each command that takes one."""
WORDS = "members by position or by name; @FILE for a list or object in a file"
TURNED = {"cursor", "after"}
"""Parameters with which the client turns pages."""


def place_of(operation: Operation) -> tuple[str, str]:
    """Return the group of an operation's command, and its name there."""
    if operation.name in PLACES:
        group, _, name = PLACES[operation.name].partition(" ")
        return group, name
    words = [part for part in operation.path.split("/") if part]
    inside = len(words) > 2 and words[0] == "missions" and (operation.paged or operation.method == "POST")
    if inside and (operation.paged or operation.name.startswith(("create_", "bulk_"))):
        words = words[2:]
    kind = KINDS.get(words[0], words[0].removesuffix("s"))
    rest = [word for word in words[1:] if not word.startswith("{")]
    if rest:
        return kind, "-".join(rest)
    verbs = {"GET": "list" if operation.paged else "show", "POST": "add", "PATCH": "set", "DELETE": "delete"}
    return kind, verbs[operation.method]


def generated() -> Mapping[str, Mapping[str, Operation]]:
    """Return the operations by group and name of their commands."""
    from ground.client.interface import operations

    found: dict[str, dict[str, Operation]] = {}
    for operation in operations().values():
        if operation.name not in BY_HAND:
            group, name = place_of(operation)
            found.setdefault(group, {})[name] = operation
    return found


class ResourceGroup(TyperGroup):
    """Commands by hand, and one for each operation beside them; that is made when it is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of all commands."""
        return sorted({*super().list_commands(ctx), *generated().get(self.name or "", ())})

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """Return a command by its name; None where there is none."""
        found = super().get_command(ctx, cmd_name)
        operation = generated().get(self.name or "", {}).get(cmd_name)
        if found is not None or operation is None:
            return found
        program = typer.Typer(add_completion=False, rich_markup_mode=None)
        about = f"{operation.about.strip()} Needs a server."
        program.command(cmd_name, help=about, short_help=first_paragraph(about))(_command(operation))
        return typer.main.get_command(program)


def group_of(app: typer.Typer, name: str) -> typer.Typer:
    """Return the group of commands with a name; it is made if there is none."""
    for known in app.registered_groups:
        if known.name == name and known.typer_instance is not None:
            return known.typer_instance
    about = ABOUT.get(name, f"{name[:1].upper()}{name[1:]}.")
    group = typer.Typer(cls=ResourceGroup, help=about, no_args_is_help=True)
    app.add_typer(group, name=name)
    return group


def register(app: typer.Typer) -> None:
    for name in [*ABOUT, *generated()]:
        group_of(app, name)


def _command(operation: Operation) -> Callable[..., None]:
    """Return the function of a command, with the signature from which its options follow."""
    found: dict[str, tuple[Any, Any]] = {"server": (str, SERVER), "person": (str | None, PERSON)}
    for p in operation.parameters["path"]:
        found[p.word] = (int if p.types == {"integer"} else str, typer.Argument(...))
    if operation.body:
        needed = [member.name.upper() for member in _by_place(operation)]
        told = " ".join([*needed, "NAME=VALUE..."])
        words = typer.Argument(
            ... if needed else None,
            metavar=told,
            help="members by position or by name; @FILE for a list or object in a file",
        )
        found["words"] = (list[str], words)
        if any(member.name == "at" for member in operation.body):
            found |= {"crs": (str | None, CRS), "lonlat": (bool, LONLAT)}
    if operation.media not in {"", "application/json", "text/plain", "text/event-stream"}:
        found["out"] = (Path, typer.Argument(..., help="file to write"))
    elif operation.method == "GET" and not operation.paged:
        found["out"] = (Path | None, typer.Option(None, "--out", help="write the answer here"))
    defaults = DEFAULTS.get(operation.name, {})
    for member in (*operation.parameters["query"], *(operation.body or ())):
        scalar = member.types & {"string", "integer", "number", "boolean"}
        if member.word in found or member.name in TURNED or not scalar:
            continue
        if member in _by_place(operation):
            continue
        about = " | ".join(member.choices) or member.about
        default = ... if member.required else defaults.get(member.name)
        option = typer.Option(default, f"--{member.word.replace('_', '-')}", help=about)
        if scalar == {"boolean"}:
            name = member.word.replace("_", "-")
            option = typer.Option(default, f"--{name}/--no-{name}", help=about)
        found[member.word] = (_python_type(scalar) | None, option)
        if member.name == "crs" and operation.method == "GET":
            found["lonlat"] = (bool, typer.Option(False, "--lonlat", help=LONLAT_HELP))
    if any(p.word == "revision" for p in operation.parameters["header"]):
        found["revision"] = (
            int | None,
            typer.Option(None, help="change only this revision; default whatever stands there"),
        )

    def command(**given: Any) -> None:
        _carry_out(operation, given)

    command.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)
            for name, (kind, default) in found.items()
        ]
    )
    command.__annotations__ = {name: kind for name, (kind, _) in found.items()}
    return command


def _by_place(operation: Operation) -> list[Member]:
    """Return the members of a body that are given by position."""
    names = {member.name for member in operation.body or () if member.required} | set(operation.first)
    return [member for member in operation.body or () if member.name in names]


def _python_type(types: Iterable[str]) -> Any:
    order = {"boolean": bool, "string": str, "number": float, "integer": int}
    return next(kind for name, kind in order.items() if name in types)


def _carry_out(operation: Operation, given: dict[str, Any]) -> None:
    where = [given.pop(p.word) for p in operation.parameters["path"]]
    server, person, out = given.pop("server"), given.pop("person"), given.pop("out", None)
    words = given.pop("words", None) or []
    at: Mapping[str, object] = {}
    if "lonlat" in given:
        given["crs"] = reference_of(given["crs"], given.pop("lonlat"))
        if operation.method != "GET" and (crs := given.pop("crs")) is not None:
            place, words = at_of(crs, words)
            at = {"at": place}
    members = {name: value for name, value in given.items() if value is not None}
    members |= _values_of(operation.body or (), words, [] if at else _by_place(operation)) | dict(at)
    forms = [p for p in operation.parameters["query"] if p.name == "form"]
    if forms and out is not None and given["form"] is None:
        members["form"] = _form(out, forms[0].choices)
    with connected(server, person) as client:
        if "upload_id" in members and not re.fullmatch(r"upl-\w+", members["upload_id"]):
            members["upload_id"] = uploaded(client, Path(members["upload_id"]))
        answer = client.call(operation, *where, **members)
        if operation.starts_job:
            typer.echo(follow(client, answer).subject_id)
        else:
            _say(operation, where, answer, out)


def _form(path: Path, forms: Sequence[str]) -> str:
    """Return the form that a file's ending names."""
    form = path.suffix.removeprefix(".").lower()
    if form not in forms:
        fail(f"{path}: the ending says the form; known are {', '.join('.' + f for f in forms)}")
    return form


def _values_of(known: Sequence[Member], words: Sequence[str], by_place: Sequence[Member]) -> dict[str, Any]:
    """Return members of a body: `name=value`, or the value alone of the next of those given by position."""
    by_name = {member.name: member for member in known}
    found: dict[str, Any] = {}
    for word in words:
        name, sign, text = word.partition("=")
        if sign and name in by_name:
            found[name] = _value(by_name[name], text)
            continue
        open_ones = [member for member in by_place if member.name not in found]
        if not open_ones:
            fail(f"{word!r}: give members as name=value; there are {', '.join(by_name)}")
        found[open_ones[0].name] = _value(open_ones[0], word)
    missing = [member.name for member in by_place if member.name not in found and "at" not in found]
    if missing:
        fail(f"{', '.join(missing)}: needed and not given")
    return found


def _value(member: Member, text: str) -> Any:
    of_file = text.startswith("@") and (member.types != {"string"} or member.name == "crl")
    if of_file:
        try:
            text = Path(text[1:]).read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as err:
            fail(f"{text[1:]}: {err}")
    if member.types == {"string"}:
        return text
    try:
        return json.loads(text)
    except ValueError:
        return text


class _Line(string.Formatter):
    """Lines with `-` for what is not there, and `:n` for how many there are."""

    def format_field(self, value: Any, format_spec: str) -> str:
        if value is None:
            return "-"
        return str(len(value)) if format_spec == "n" else str(format(value, format_spec))


def _where(item: Any) -> str:
    """Return what a line says behind its end of where a thing lies in the reference that was asked for."""
    at = item.get("at") if isinstance(item, dict) else None
    if at is None:
        return ""
    corners = at["polygon"] if "polygon" in at else [[at["x"], at["y"]]]
    told = " ".join(f"{x:.10g},{y:.10g}" for x, y in corners)
    return f"  {at['crs'] if len(at['crs']) < 60 else 'WKT'}  {told}".replace("{", "{{").replace("}", "}}")


def _say(operation: Operation, where: Sequence[str | int], answer: Any, out: Path | None) -> None:
    """Print what came back, or write it."""
    line = LINES.get(operation.name)
    if operation.media == "application/json" and out is not None:
        written(out, json.dumps(answer, indent=1, ensure_ascii=False).encode())
    elif out is not None:
        written(out, answer.encode() if isinstance(answer, str) else answer)
    elif line is not None and isinstance(answer, dict) and "items" in answer:
        if answer.get("trouble"):
            typer.echo(answer["trouble"])
        for item in answer["items"]:
            typer.echo(_Line().vformat(line, (), item))
    elif operation.paged or (line is not None and isinstance(answer, list)):
        for item in answer:
            typer.echo(_Line().vformat((line or "{id}") + _where(item), (), item))
    elif operation.media == "text/event-stream":
        for event in answer:
            typer.echo(json.dumps(event, ensure_ascii=False))
    elif line is not None:
        typer.echo(_Line().vformat(line, (), answer))
    elif operation.method == "PATCH":
        typer.echo(f"{where[-1]} revision {answer.revision}")
    elif operation.method == "POST" and isinstance(answer, dict) and "id" in answer:
        typer.echo(answer["id"])
    elif isinstance(answer, str):
        typer.echo(answer, nl=False)
    elif answer is not None:
        show(answer)
