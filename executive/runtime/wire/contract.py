"""What a rover on the wire owes the executive, as checks on a wall clock over whatever link there is.

`outcrop rover check --hardware --connect URL` runs them, and so do the tests for the reference rovers. They
move nothing: they use the action `wait` (parameter `duration_s`), one that no rover knows, and `image` where
the rover has it. Each check is a run of its own on the same rover.
"""

from __future__ import annotations

import hashlib
import secrets
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from executive.errors import WireError
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    Event,
    Product,
    Result,
    Update,
    Value,
)
from executive.runtime.wire.address import Address, Keys
from executive.runtime.wire.client import WireRover
from executive.runtime.wire.line import WireOptions

Make = Callable[[str, Path], WireRover]


@dataclass(frozen=True, slots=True)
class WireFinding:
    """One check and its outcome; `detail` says what was wrong, `note` what could not be looked at."""

    name: str
    detail: str = ""
    note: str = ""

    @property
    def passed(self) -> bool:
        return not self.detail


class _BrokenError(Exception):
    """What a check found wrong."""


class _SkippedError(Exception):
    """Why a check has nothing to look at."""


def _need(condition: bool, detail: str) -> None:
    if not condition:
        raise _BrokenError(detail)


class _Bench:
    """One run on the rover: sends, hears, and knows how long an answer may take over this link."""

    def __init__(self, make: Make, folder: Path, patience_s: float) -> None:
        self.run = f"check-{secrets.token_hex(4)}"
        self.make, self.folder, self.patience_s = make, folder, patience_s
        self.rover = make(self.run, folder)
        self.heard: list[Event] = []
        self.taken: dict[CommandId, int] = {}
        """How far each command's answers were looked at."""
        self.count = 0

    def begin(self) -> None:
        self.rover.wait_ready(self.patience_s)

    def close(self) -> None:
        self.rover.stop()
        self.rover.wait_for_products(1.0)
        end = time.monotonic() + self.patience_s
        while self.rover.link().commands and time.monotonic() < end:
            self.hear()
        self.rover.close(over=True)

    def hear(self) -> Event | None:
        event = self.rover.next_event(0)
        if event is not None:
            self.heard.append(event)
        return event

    def send(self, action: str, **parameters: Value) -> Command:
        self.count += 1
        command = Command(CommandId(self.run, f"{action}-{self.count}", 1), action, parameters)
        self.rover.send(command)
        return command

    def answer(self, command: CommandId, within_s: float = 0.0) -> Result | Acknowledgement:
        end = time.monotonic() + within_s + self.patience_s
        while time.monotonic() < end:
            self.hear()
            for place in range(self.taken.get(command, 0), len(self.heard)):
                event = self.heard[place]
                if isinstance(event, Result | Acknowledgement) and event.command == command:
                    self.taken[command] = place + 1
                    return event
        raise _BrokenError(f"{command.task} has no answer after {within_s + self.patience_s:g} s")

    def settle(self, seconds: float) -> None:
        """Hear whatever still comes in some seconds."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.hear()

    def answers(self, command: CommandId) -> list[Event]:
        return [e for e in self.heard if isinstance(e, Result | Acknowledgement) and e.command == command]


# ---- the checks


def _tells_its_state(bench: _Bench) -> None:
    end = time.monotonic() + bench.patience_s  # a sensor may give its first word a while after the start
    while not (state := bench.rover.present_state()) and time.monotonic() < end:
        bench.settle(0.1)
    _need(bool(state), f"it has no state after {bench.patience_s:g} s")
    bench.settle(0.2)
    first = bench.heard[0] if bench.heard else None
    _need(isinstance(first, Update), f"the first event of a run is {first!r:.80}, no update")


def _does_a_command_once(bench: _Bench) -> None:
    command = bench.send("wait", duration_s=0.5)
    answer = bench.answer(command.id, 0.5)
    _need(isinstance(answer, Result) and answer.success, f"a wait of 0.5 s gave {answer!r:.120}")
    bench.rover.send(command)  # as an executive does that does not know whether it was heard
    bench.settle(1.0)
    _need(len(bench.answers(command.id)) == 1, "a repeat of a command was carried out again")
    status = bench.rover.status(command.id)
    _need(status.state is CommandState.DONE, f"a command that is over is {status.state.value}")
    same = isinstance(status.result, Result) and status.result.success
    _need(same, f"the status of a wait that succeeded holds {status.result!r:.120}")


def _knows_what_runs(bench: _Bench) -> None:
    unknown = bench.rover.status(CommandId(bench.run, "never-sent", 1))
    _need(unknown.state is CommandState.UNKNOWN, f"a command never sent is {unknown.state.value}")
    begun = time.monotonic()
    longer, shorter = bench.send("wait", duration_s=4.0), bench.send("wait", duration_s=0.2)
    bench.answer(shorter.id, 0.2)
    state = bench.rover.status(longer.id).state
    late = time.monotonic() - begun >= 4.0  # the link took so long that it may be over
    right = state is CommandState.RUNNING or (late and state is CommandState.DONE)
    _need(right, f"a wait of 4 s is {state.value} after {time.monotonic() - begun:.1f} s")
    _need(isinstance(bench.answer(longer.id, 4.0), Result), "a wait ended without a result")


def _refuses_with_a_reason(bench: _Bench) -> None:
    answer = bench.answer(bench.send("dance").id)
    _need(isinstance(answer, Result) and not answer.success, "the action dance did not fail")
    _need(isinstance(answer, Result) and bool(answer.reason), "the action dance failed without a reason")


def _acknowledges_an_abort(bench: _Bench) -> None:
    command = bench.send("wait", duration_s=1000.0)
    bench.settle(0.3)
    bench.rover.abort(command.id)
    answer = bench.answer(command.id)
    _need(isinstance(answer, Acknowledgement), "an aborted wait gave a result, no acknowledgement")
    bench.rover.abort(command.id)
    after = bench.answer(bench.send("wait", duration_s=0.1).id, 0.1)
    _need(isinstance(after, Result) and after.success, "a wait after an abort failed")
    _need(len(bench.answers(command.id)) == 1, "an abort was acknowledged twice")


def _never_begins_what_was_called_off(bench: _Bench) -> None:
    command = Command(CommandId(bench.run, "called-off", 1), "wait", {"duration_s": 0.1})
    bench.rover.abort(command.id)
    answer = bench.answer(command.id)
    _need(isinstance(answer, Acknowledgement), "an abort of what was never sent is not acknowledged")
    bench.rover.send(command)
    bench.settle(1.0)
    _need(len(bench.answers(command.id)) == 1, "a command that was called off before it came was begun")


def _stops_everything(bench: _Bench) -> None:
    both = [bench.send("wait", duration_s=1000.0) for _ in range(2)]
    bench.settle(0.3)
    bench.rover.stop()
    for command in both:
        _need(isinstance(bench.answer(command.id), Acknowledgement), "a stop gave a result")
    speed = bench.rover.present_state().get("wheel-speed", 0.0)
    _need(speed == 0.0, f"after a stop the wheels turn at {speed}")


def _keeps_its_word_until_it_is_durable(bench: _Bench) -> None:
    command = bench.send("wait", duration_s=0.1)
    bench.answer(command.id, 0.1)
    numbers = [getattr(event, "number", 0) for event in bench.heard]
    _need(numbers == sorted(set(numbers)), f"the numbers of its word do not grow: {numbers[:10]}")
    _need(0 not in numbers, "an event of its stream has no number")
    bench.rover.close()  # an executive that dies before anything was durable
    bench.rover = bench.make(bench.run, bench.folder)
    again = bench.answer(command.id, 1.0)
    _need(isinstance(again, Result), "what was not durable was not said again")
    bench.rover.commit(again.number)
    bench.settle(1.0)
    bench.rover.close()
    bench.rover = bench.make(bench.run, bench.folder)
    later = bench.rover.since(again.number)
    told = [e for e in later if isinstance(e, Result) and e.command == command.id]
    _need(not told, "what is durable was said again")


def _outlives_a_broken_line(bench: _Bench) -> None:
    command = bench.send("wait", duration_s=1.5)
    bench.settle(0.3)
    bench.rover.break_line()
    answer = bench.answer(command.id, 1.5)
    _need(isinstance(answer, Result) and answer.success, "a line that broke stopped an action")
    _need(len(bench.answers(command.id)) == 1, "a result came twice after the line had broken")


def _outlives_nonsense(bench: _Bench) -> None:
    for bad in (b"\xff\xff\xff\xff", b"\x00\x00\x00\x05hello", b"\x00\x00\x00\x02[]", b"GET / HTTP/1.1\r\n"):
        bench.rover.say_raw(bad)
        bench.settle(0.3)
    answer = bench.answer(bench.send("wait", duration_s=0.1).id, 0.1)
    _need(isinstance(answer, Result) and answer.success, "after frames that lie a wait failed")


def _gives_its_products_down(bench: _Bench) -> None:
    command = bench.send("image")
    answer = bench.answer(command.id, 30.0)
    bench.settle(0.5)
    made = [e for e in bench.heard if isinstance(e, Product)]
    if not made:
        why = answer.reason if isinstance(answer, Result) else "it was aborted"
        raise _SkippedError(f"image without parameters made no product ({why or 'it gave no reason'})")
    left = bench.rover.wait_for_products(bench.patience_s)
    _need(left == 0, f"{left} files did not come down")
    for product in made:
        path = bench.folder / product.path
        _need(path.is_file(), f"{product.path} did not come down")
        found = hashlib.sha256(path.read_bytes()).hexdigest()
        _need(found == product.sha256, f"{product.path} has SHA-256 {found[:12]}, not {product.sha256[:12]}")


CHECKS: tuple[Callable[[_Bench], None], ...] = (
    _tells_its_state,
    _does_a_command_once,
    _knows_what_runs,
    _refuses_with_a_reason,
    _acknowledges_an_abort,
    _never_begins_what_was_called_off,
    _stops_everything,
    _keeps_its_word_until_it_is_durable,
    _outlives_a_broken_line,
    _outlives_nonsense,
    _gives_its_products_down,
)


def check_wire(
    where: Address, *, keys: Keys | None = None, patience_s: float = 20.0, options: WireOptions | None = None
) -> list[WireFinding]:
    """Return what each check found for the rover at an address.

    `patience_s` is how long an answer may take beyond what the action itself takes: more than the longest
    time for which the link is away.
    """
    chosen = options or WireOptions(patience_s=patience_s)

    def make(run: str, folder: Path) -> WireRover:
        return WireRover(where, run=run, keys=keys, out=folder, options=chosen)

    findings = []
    for check in CHECKS:
        name = check.__name__.strip("_").replace("_", " ")
        with tempfile.TemporaryDirectory() as folder:
            findings.append(_finding(name, check, make, Path(folder), patience_s))
    return findings


def _finding(
    name: str, check: Callable[[_Bench], None], make: Make, folder: Path, patience_s: float
) -> WireFinding:
    bench = _Bench(make, folder, patience_s)
    try:
        bench.begin()
    except WireError as error:
        bench.rover.close()
        return WireFinding(name, str(error))
    try:
        check(bench)
    except _SkippedError as why:
        return WireFinding(name, note=str(why))
    except (_BrokenError, WireError) as error:
        return WireFinding(name, str(error))
    finally:
        bench.close()
    return WireFinding(name)


def as_lines(findings: list[WireFinding], name: str) -> list[str]:
    """Return findings as lines for people, a count at the end."""
    lines = []
    for finding in findings:
        lines.append(f"{'ok  ' if finding.passed else 'FAIL'}  {finding.name}")
        lines += [f"      {text}" for text in (finding.detail, finding.note) if text]
    broken = sum(not finding.passed for finding in findings)
    return [*lines, f"{name}: {len(findings) - broken} of {len(findings)} checks passed"]
