"""Messages of `wire/1`: from what came in to values, strictly; `docs/reference/wire.md` lists them.

Nothing that the other end sends may raise anything but `WireError`, whose message is a sentence for the log.
"""

from __future__ import annotations

from executive.errors import WireError
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    CommandStatus,
    Event,
    Product,
    Result,
    Update,
    Value,
)
from executive.runtime.codec import (
    Json,
    command_id_to_json,
    command_to_json,
    event_from_json,
    event_to_json,
)

PROTOCOL = "wire/1"
KINDS = ("update", "result", "acknowledgement", "product")
"""Events that a rover may tell."""
HIGHEST = 2**53 - 1
"""The largest integer that every reader of JSON keeps exactly (RFC 8259, section 6)."""


def whole(document: Json, member: str, *, least: int = 0) -> int:
    """Return an integer member.

    Raises
    ------
    WireError
        If it is none, or outside `least` to 2^53 - 1.
    """
    value = document.get(member)
    if type(value) is not int or not least <= value <= HIGHEST:
        raise WireError(f"{_name(document)}: {member} is {_show(value)}, no integer from {least} on")
    return value


def text(document: Json, member: str) -> str:
    """Return a text member.

    Raises
    ------
    WireError
        If it is none.
    """
    value = document.get(member)
    if not isinstance(value, str):
        raise WireError(f"{_name(document)}: {member} is {_show(value)}, no text")
    return value


def mapping(document: Json, member: str) -> dict[str, object]:
    """Return an object member, empty where it is absent.

    Raises
    ------
    WireError
        If it is something else.
    """
    value = document.get(member, {})
    if not isinstance(value, dict):
        raise WireError(f"{_name(document)}: {member} is {_show(value)}, not an object")
    return value


def command_id(document: Json, member: str = "id") -> CommandId:
    """Return the id of a command, `[run, task, attempt]`.

    Raises
    ------
    WireError
        If it is no such list.
    """
    match document.get(member):
        case [str(run), str(task), int(attempt)] if not isinstance(attempt, bool):
            return CommandId(run, task, attempt)
        case value:
            raise WireError(f"{_name(document)}: {member} is {_show(value)}, not [run, task, attempt]")


def send_message(command: Command) -> dict[str, object]:
    return {"m": "send", **command_to_json(command)}


def command_of(message: Json) -> Command:
    """Return the command of a message `send`."""
    issue = message.get("issue", 1)
    return Command(
        command_id(message),
        text(message, "action"),
        _values(message, "parameters"),
        _values(message, "metadata"),
        issue if type(issue) is int else 1,
    )


def about(kind: str, command: CommandId) -> dict[str, object]:
    """Return a message that is about a command."""
    return {"m": kind, "id": command_id_to_json(command)}


def event_message(event: Event) -> dict[str, object]:
    return {"m": "event", "event": event_to_json(event)}


def event_of(document: Json) -> Event:
    """Return an event that a rover tells; what its values hold is looked at later (`sanitize`).

    Raises
    ------
    WireError
        If it is none: a member is missing or of the wrong type.
    """
    kind = document.get("e")
    if kind not in KINDS:
        raise WireError(f"an event of kind {_show(kind)}; known are {', '.join(KINDS)}")
    whole(document, "t")
    whole({"number": 0, **document}, "number")
    clean = dict(document)
    if kind != "update":
        command_id(document, "command")
    match kind:
        case "update":
            mapping(document, "values")
            clean.setdefault("values", {})
        case "result":
            clean.update(
                success=document.get("success"),
                reason=str(document.get("reason", ""))[:1000],
                values=mapping(document, "values"),
                updates=mapping(document, "updates"),
            )
        case "acknowledgement":
            clean["updates"] = mapping(document, "updates")
        case _:
            for member in ("kind", "path", "sha256"):
                text(document, member)
            clean["label"] = _values(document, "label")
    return event_from_json(clean)


def status_of(message: Json) -> CommandStatus:
    """Return what a message `status` says of a command."""
    try:
        state = CommandState(text(message, "state"))
    except ValueError:
        raise WireError(f"status: state is {_show(message.get('state'))}") from None
    if state is not CommandState.DONE:
        return CommandStatus(state)
    event = event_of(mapping(message, "result"))
    if not isinstance(event, Result | Acknowledgement):
        raise WireError("status: the result is neither a result nor an acknowledgement")
    return CommandStatus(state, event)


def status_message(command: CommandId, status: CommandStatus) -> dict[str, object]:
    message = {**about("status", command), "state": status.state.value}
    return message if status.result is None else {**message, "result": event_to_json(status.result)}


def numbered(event: Event) -> Update | Result | Acknowledgement | Product:
    """Return an event of a rover's stream; an operator's command is none."""
    if not isinstance(event, Update | Result | Acknowledgement | Product):
        raise WireError(f"{type(event).__name__} is not an event of a rover")
    return event


def _values(document: Json, member: str) -> dict[str, Value]:
    held = mapping(document, member)
    return {k: v for k, v in held.items() if isinstance(v, str | bool | int | float)}


def _name(document: Json) -> str:
    return str(document.get("m") or document.get("e") or "message")[:40]


def _show(value: object) -> str:
    return ascii(value)[:60]
