"""The control socket of a live run: how other processes hold, step, abort or stop it.

It belongs to a thread of the run's own process and needs nothing else: no database, no server, no planner. A
request is one frame with a member `m`, the answer one frame with `ok`. `outcrop stop` and the API speak it.
"""

from __future__ import annotations

import contextlib
import logging
import socket
import threading
import time
from collections.abc import Callable
from enum import StrEnum
from pathlib import Path

from executive.errors import WireError
from executive.ports import Link
from executive.runtime.codec import command_id_to_json
from executive.runtime.live import LiveRuntime
from executive.runtime.wire.address import Address, dial, listen
from executive.runtime.wire.frames import FrameReader, frame

logger = logging.getLogger(__name__)

CONTROL_SOCKET = "control.sock"
"""In the folder of a live run, mode 0600."""
AGAIN_S = 0.1
"""How long the socket waits after it could not take a connection."""
ANSWER_S = 2.0
"""How long an answer may take before the run counts as hung."""

STOP_S = 1.0
"""How long an answer to a stop waits for the rover's word; less than `ANSWER_S`."""
STOP_POLL_S = 0.002


class Stopped(StrEnum):
    """What is known of the rover when a run has been told to stop."""

    CONFIRMED = "stopped"
    """It says that it has stopped."""
    ASKED = "asked"
    """It was told, or will be when there is a line, and has said nothing yet."""
    SAFEMODE = "safemode"
    """It has no link of its own and was sent the command `safemode`."""


def link_document(runtime: LiveRuntime) -> dict[str, object]:
    """Return the state of link and queue of a run as JSON."""
    document: dict[str, object] = {"t_s": runtime.clock.now_ms() / 1000}
    if not isinstance(runtime.port, Link):
        return document
    state = runtime.port.link()
    return document | {
        "up": state.up,
        "age_s": state.age_s,
        "round_trip_s": state.round_trip_s,
        "offset_s": state.offset_s,
        "breaks": state.breaks,
        "commands": [{"id": command_id_to_json(c), "state": s} for c, s in state.commands],
    }


class RunControl:
    """Does what is asked of a run; `inject` lets a simulated rover suffer a `fault/1`."""

    def __init__(
        self, runtime: LiveRuntime, inject: Callable[[dict[str, object]], None] | None = None
    ) -> None:
        self.runtime, self._inject = runtime, inject
        self.stopped = False
        """Somebody stopped or aborted the run."""
        self.steps = 0

    @property
    def held(self) -> bool:
        """Whether the plan is held, or goes on no further than a step."""
        return self.runtime.held

    def _wait_for_stop(self) -> Stopped:
        """Return how the rover stands after a stop; waits a while for its word."""
        port = self.runtime.port
        if not isinstance(port, Link):
            return Stopped.SAFEMODE
        end = time.monotonic() + STOP_S
        while port.link().stopping:
            if time.monotonic() > end:
                return Stopped.ASKED
            time.sleep(STOP_POLL_S)
        return Stopped.CONFIRMED

    def _note(self, what: str, request: dict[str, object]) -> None:
        """Note in the journal what an operator did, and who it was where the request says `by` whom."""
        by = str(request.get("by", ""))[:80]
        self.runtime.complain("operator", f"{what} by {by}" if by else what)

    def answer(self, request: dict[str, object]) -> dict[str, object]:
        """Return the answer to a request; one that cannot be met says why."""
        runtime = self.runtime
        match request.get("m"):
            case "stop":
                self.stopped = True
                self._note("STOP", request)
                runtime.emergency_stop()
                return {"ok": True, "rover": self._wait_for_stop().value}
            case "abort":
                self.stopped = True
                self._note("aborted", request)
                runtime.stop()
            case "hold":
                runtime.pause()
            case "go":
                runtime.resume()
            case "step":
                self.steps += 1
                runtime.step()
            case "replace" if isinstance(plan := request.get("plan"), str):
                runtime.replace(plan)
            case "inject" if self._inject is not None:
                fault = request.get("fault")
                if not isinstance(fault, dict):
                    reason = f"inject needs a fault/1 as a JSON object under `fault`, found {fault!a:.40}"
                    return {"ok": False, "reason": reason}
                self._inject(fault)
                self._note(f"fault {str(fault.get('kind'))[:40]!a} injected", request)
            case "state":
                return {
                    "ok": True,
                    "held": self.held,
                    "steps": self.steps,
                    "stopped": self.stopped,
                    "link": link_document(runtime),
                }
            case "inject":
                return {"ok": False, "reason": "this rover takes no faults"}
            case other:
                return {"ok": False, "reason": f"{str(other)[:40]!a} is nothing a run can be asked"}
        return {"ok": True}


class ControlSocket:
    """Listens in the folder of a run until it is closed."""

    def __init__(self, folder: Path, control: RunControl) -> None:
        self._control = control
        self._path = folder / CONTROL_SOCKET
        self._closed = threading.Event()
        self._door = listen(Address(self._path))
        self._thread = threading.Thread(target=self._serve, name="control", daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        """Answer until closed: out of files or threads, the way for a stop must come back when they do."""
        while not self._closed.is_set():
            try:
                line, _ = self._door.accept()
                with contextlib.ExitStack() as unless_answered:
                    unless_answered.callback(line.close)
                    # a thread each: whoever connects and says nothing must not keep a stop waiting
                    threading.Thread(target=self._answer, args=(line,), name="control", daemon=True).start()
                    unless_answered.pop_all()
            except (OSError, RuntimeError) as error:  # RuntimeError: no thread can be started
                if not self._closed.is_set():
                    logger.warning("control socket", extra={"error": str(error)})
                    self._closed.wait(AGAIN_S)

    def _answer(self, line: socket.socket) -> None:
        with line, contextlib.suppress(OSError):
            line.settimeout(ANSWER_S)
            try:
                answer = self._control.answer(_receive(line))
            except Exception as error:
                logger.exception("a request to the run failed")
                answer = {"ok": False, "reason": str(error)[:400]}
            line.sendall(frame(answer))

    def close(self) -> None:
        self._closed.set()
        with contextlib.suppress(OSError):
            self._door.shutdown(socket.SHUT_RDWR)
        self._door.close()
        self._path.unlink(missing_ok=True)


def _receive(line: socket.socket) -> dict[str, object]:
    reader = FrameReader()
    while True:
        data = line.recv(1 << 16)
        if not data:
            raise WireError("the line was closed")
        found = reader.feed(data)
        if found:
            return found[0]


def ask_run(folder: Path, request: dict[str, object], timeout_s: float = ANSWER_S) -> dict[str, object]:
    """Return the answer of the live run in a folder.

    Raises
    ------
    WireError
        If no run goes on there, it does not answer in time, or it refuses.
    """
    try:
        with dial(Address(folder / CONTROL_SOCKET), timeout_s=timeout_s) as line:
            line.sendall(frame(request))
            answer = _receive(line)
    except TimeoutError as error:
        raise WireError(f"the run in {folder} does not answer within {timeout_s:g} s") from error
    except OSError as error:
        raise WireError(f"the run in {folder} does not answer: {error.strerror or error}") from error
    if answer.get("ok") is not True:
        raise WireError(f"the run in {folder} refuses: {answer.get('reason')}")
    return answer
