"""A straight run as a sequence: F Prime's `.seq` text, and PlanDev's seq-json.

`.seq` is the text that `fprime-seqgen` of F Prime's ground data system reads: a time tag, a command, its
arguments. R tags wait after the command before has ended; A tags are UTC, year and day of year. seq-json is
that of NASA-AMMOS/seq-json-schema 1.3.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from typing import Literal, TypeAlias, assert_never

from executive.crl.nodes import Task
from executive.crl.values import Value
from neighbours.flight.errors import SequenceError
from neighbours.flight.flight_map import Constant, FlightMap, MappedCommand
from neighbours.flight.foreign import (
    Choice,
    Flag,
    ForeignCommand,
    ForeignDictionary,
    ForeignType,
    Group,
    Leaf,
    Number,
    Series,
    Text,
    Unsaid,
    leaves,
)
from neighbours.flight.import_dictionary import action_name
from neighbours.flight.straight_run import Step, StraightRun

_DAY_S = 86400.0

Json: TypeAlias = "dict[str, Json] | list[Json] | str | float | bool | None"


@dataclass(frozen=True, slots=True)
class SentCommand:
    """A command of a sequence: the value of each plain argument by its name, and when it is sent.

    `delay_s` counts from the end of the command before, `waits_s` of it are tasks that wait; `not_before_s`
    counts from the plan's start.
    """

    task: str
    command: ForeignCommand
    values: Mapping[str, Value]
    delay_s: float
    waits_s: float
    not_before_s: float | None


def sent_commands(run: StraightRun, foreign: ForeignDictionary, mapped: FlightMap) -> tuple[SentCommand, ...]:
    """Return the commands of a run in the words of a dictionary.

    Raises
    ------
    SequenceError
        If a task has no command, or an argument has no value or one that the command does not take; all are
        named.
    """
    commands = {action_name(c.name): c for c in foreign.commands}
    by_name = {c.name: c for c in foreign.commands}
    wrong: list[str] = []
    made: list[SentCommand] = []
    delay_s = 0.0
    for step in run.steps:
        task = step.task
        if task.action == "wait" and "wait" not in mapped.sent and "wait" not in commands:
            delay_s += step.time_s
            continue
        sent = mapped.sent.get(task.action)
        command = commands.get(task.action) if sent is None else by_name.get(sent.command)
        if command is None:
            wanted = f"sent.{task.action} of the map" if sent is None else f'the command "{sent.command}"'
            wrong.append(f'task "{task.id}": action "{task.action}" has no command: {wanted} is missing')
            continue
        given: dict[str, Value] = {
            n: _plain(v) for n, v in mapped.commands.get(command.name, MappedCommand()).arguments.items()
        }
        given |= task.parameters if sent is None else _stood_for(sent.arguments, task, wrong)
        values = _checked(command, given, task.id, wrong)
        delay = delay_s + _gap(step, run)
        made.append(SentCommand(task.id, command, values, delay, delay_s, step.not_before_s))
        delay_s = 0.0
    if wrong:
        raise SequenceError("; ".join(wrong))
    return tuple(made)


def unsaid_times(
    commands: tuple[SentCommand, ...], form: Literal["seq", "seq-json"], epoch: datetime | None
) -> tuple[str, ...]:
    """Return what a form cannot say of when commands are sent, each by name."""
    told = []
    for sent in commands:
        opens = sent.not_before_s is not None
        if sent.waits_s and (form == "seq-json" or (opens and epoch is not None)):
            told.append(f'wait of {sent.waits_s:g} s before "{sent.task}"')
        if opens and form == "seq" and epoch is None:
            told.append(
                f'window of "{sent.task}" opens at {sent.not_before_s:g} s: without --epoch it is a wait '
                "by mean times, and the command may come before it"
            )
    return tuple(told)


def _gap(step: Step, run: StraightRun) -> float:
    """Return the wait between the expected end of the step before and the opening of a step's window."""
    if step.not_before_s is None:
        return 0.0
    ends = [s.start_s + s.time_s for s in run.steps[: run.steps.index(step)]]
    return max(0.0, step.start_s - max(ends, default=0.0))


def _plain(value: Constant) -> Value:
    return value if isinstance(value, bool | str) else float(value)


def _stood_for(arguments: Mapping[str, Constant], task: Task, wrong: list[str]) -> dict[str, Value]:
    found: dict[str, Value] = {}
    for name, constant in arguments.items():
        if not isinstance(constant, str) or not constant.startswith("$"):
            found[name] = _plain(constant)
        elif constant[1:] in task.parameters:
            found[name] = task.parameters[constant[1:]]
        else:
            have = ", ".join(task.parameters) or "none"
            wrong.append(f'task "{task.id}" has no parameter "{constant[1:]}" for {name}; it has {have}')
    return found


def _checked(
    command: ForeignCommand, given: Mapping[str, Value], task: str, wrong: list[str]
) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for argument in command.arguments:
        for name, leaf in leaves(argument.name, argument.type):
            where = f'task "{task}": argument {name} of {command.name}'
            if name not in given:
                wrong.append(f"{where} has no value")
                continue
            fault = _fault(leaf, given[name])
            if fault:
                wrong.append(f"{where} is {given[name]!r}; {fault}")
            values[name] = given[name]
    return values


def _fault(leaf: Leaf, value: Value) -> str:
    """Return what is wrong with a value for a type, or an empty string."""
    match leaf:
        case Number(low, high, _, whole):
            if isinstance(value, bool) or not isinstance(value, int | float):
                return "it must be a number"
            if not math.isfinite(value) or (whole and value != int(value)):
                return f"it must be a {'whole' if whole else 'finite'} number"
            if low is not None and value < low:
                return f"it must be at least {low:g}"
            return f"it must be at most {high:g}" if high is not None and value > high else ""
        case Text(longest):
            if not isinstance(value, str):
                return "it must be a string"
            if longest is not None and len(value.encode()) > longest:
                return f"it has {len(value.encode())} bytes and may have {longest}"
            return (
                "" if _quoted(value) else "it has line ends, a backslash at its end or both kinds of quotes"
            )
        case Choice(labels):
            return "" if value in labels else f"it must be one of {', '.join(labels)}"
        case Flag():
            return "" if isinstance(value, bool) else "it must be true or false"
        case Unsaid(reason):
            return f"it is a {reason}, which has no form"
        case _:
            assert_never(leaf)


def seq_text(
    commands: tuple[SentCommand, ...], title: str, notes: tuple[str, ...], epoch: datetime | None
) -> str:
    """Return a run as F Prime's `.seq` text; with `epoch`, the UTC of the plan's start, windows are absolute.

    Raises
    ------
    SequenceError
        If a wait takes a day or more: a relative tag has hours of one day.
    """
    lines = [f"; {title}", *(f"; not said: {note}" for note in notes)]
    for sent in commands:
        arguments = " ".join(_written(a.name, a.type, sent.values) for a in sent.command.arguments)
        lines.append(f"; {sent.task}")
        lines.append(f"{_tag(sent, epoch)} {sent.command.name} {arguments}".rstrip())
    return "\n".join(lines) + "\n"


def _tag(sent: SentCommand, epoch: datetime | None) -> str:
    if epoch is not None and sent.not_before_s is not None:
        return f"A{_day_of_year(epoch, sent.not_before_s)}"
    if round(1000 * sent.delay_s) >= 1000 * _DAY_S:
        raise SequenceError(f'task "{sent.task}" waits {sent.delay_s:g} s; a relative tag is less than a day')
    return f"R{_clock(sent.delay_s)}"


def _clock(seconds: float) -> str:
    whole, ms = divmod(round(1000 * seconds), 1000)
    text = f"{whole // 3600:02d}:{whole // 60 % 60:02d}:{whole % 60:02d}"
    return f"{text}.{ms:03d}" if ms else text


def _day_of_year(epoch: datetime, t_s: float) -> str:
    at = epoch.astimezone(UTC) + timedelta(milliseconds=round(1000 * t_s))
    return at.strftime("%Y-%jT%H:%M:%S.") + f"{at.microsecond // 1000:03d}"


def _written(name: str, kind: ForeignType, values: Mapping[str, Value]) -> str:
    match kind:
        case Series(item, length):
            return f"[{', '.join(_written(f'{name}.{k}', item, values) for k in range(length))}]"
        case Group(members):
            return "{" + ", ".join(f"{m}: {_written(f'{name}.{m}', t, values)}" for m, t in members) + "}"
        case Text():
            return _quoted(str(values[name]))
        case Number(whole=whole):
            return str(int(values[name])) if whole else repr(float(values[name]))
        case _:
            return str(values[name])


def _quoted(text: str) -> str:
    """Return a string as `.seq` writes it, empty where it cannot: the form has no escapes."""
    if any(c in text for c in "\r\n") or text.endswith("\\"):
        return ""
    for quote in "\"'":
        if quote not in text:
            return f"{quote}{text}{quote}"
    return ""


def seq_json(
    commands: tuple[SentCommand, ...], name: str, notes: tuple[str, ...], epoch: datetime | None
) -> Mapping[str, Json]:
    """Return a run as a seq-json document; values of arrays and structs are arguments one by one.

    Without `epoch` the opening of a window counts from the plan's start (EPOCH_RELATIVE).
    """
    steps: list[Json] = [
        {
            "type": "command",
            "stem": sent.command.name,
            "time": _json_time(sent, epoch),
            "args": [
                _json_argument(label, leaf, sent.values[label])
                for argument in sent.command.arguments
                for label, leaf in leaves(argument.name, argument.type)
            ],
            "metadata": {"task": sent.task},
        }
        for sent in commands
    ]
    return {"id": name, "metadata": {"not_said": list(notes)}, "steps": steps}


def _json_time(sent: SentCommand, epoch: datetime | None) -> Json:
    if sent.not_before_s is not None and epoch is not None:
        return {"type": "ABSOLUTE", "tag": _day_of_year(epoch, sent.not_before_s)}
    if sent.not_before_s is not None:
        return {"type": "EPOCH_RELATIVE", "tag": _clock(sent.not_before_s)}
    return {"type": "COMMAND_COMPLETE"}


def _json_argument(name: str, leaf: Leaf, value: Value) -> Json:
    match leaf:
        case Number(whole=whole):
            return {"type": "number", "name": name, "value": int(value) if whole else float(value)}
        case Flag():
            return {"type": "boolean", "name": name, "value": bool(value)}
        case _:
            return {"type": "string", "name": name, "value": str(value)}
