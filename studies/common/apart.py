"""Behaviour in a process of its own: hardware served over a pipe, no simulated world on its import path.

Run as a module this is the child; `ApartRepertoire` starts one and stands in for a `Repertoire`. Messages are
pickled tuples. While the parent waits for an answer it serves what the child asks of the hardware at once;
what takes time goes back to the parent, which waits for it on the rover's clock and resumes the action.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from dataclasses import dataclass
from importlib.machinery import ModuleSpec
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, cast

from executive.ports import Command
from rover_iface.behaviour import repertoire
from rover_iface.behaviour.action import Action
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.repertoire import MakeRepertoire, Repertoire, Targets
from rover_iface.profile import RoverProfile, load_profile

WORLD = "rover_iface.simulator"
KINDS: Mapping[str, MakeRepertoire] = {"subframe": repertoire.subframe, "full": repertoire.full}
PROPERTIES = frozenset({"t_s", "drawn_j", "believed", "travelled_m", "cameras_work", "keeps_products"})
TAKES_TIME = frozenset({"spend", "operate", "drive", "move_arm"})

Message = tuple[Any, ...]


class ApartRepertoire(Repertoire):
    """A repertoire whose actions run in a process without the simulated world."""

    def __init__(self, kind: str, hardware: Hardware, targets: Targets, tracker: str = "") -> None:
        self.hardware = hardware
        self._count = 0
        self._pipe, theirs = Pipe()
        self._child = subprocess.Popen(
            [sys.executable, "-m", "studies.common.apart", str(theirs.fileno())], pass_fds=[theirs.fileno()]
        )
        theirs.close()
        self._ask("make", kind, hardware.profile.name, dict(targets), tracker)

    def act(self, command: Command) -> Action | None:
        """Return the action of a command, carried out in the other process."""
        self._count += 1
        (known,) = self._ask("act", self._count, command)
        return self._carry_out(self._count) if known else None

    def close(self) -> list[str]:
        """End the process; return the modules of the simulated world that it had, which should be none."""
        (seen,) = self._ask("quit")
        self._child.wait()
        return list(seen)

    def _carry_out(self, number: int) -> Action:
        resume: Message = ("value", None)
        try:
            while True:
                kind, *rest = self._ask("go", number, resume)
                if kind == "done":
                    return rest[0]
                if kind == "raised":
                    raise rest[0]
                name, arguments, named = rest
                try:
                    resume = ("value", (yield from getattr(self.hardware, name)(*arguments, **named)))
                except Exception as err:  # noqa: BLE001 - belongs to the action in the other process
                    resume = ("error", err)
        except GeneratorExit:
            self._ask("close", number)
            raise

    def _ask(self, *message: Any) -> Message:
        """Send a message and return the answer, serving the hardware meanwhile."""
        self._pipe.send(message)
        while True:
            kind, *rest = self._pipe.recv()
            if kind == "answer":
                return tuple(rest)
            name, arguments, named = rest
            try:
                found = getattr(self.hardware, name)
                self._pipe.send(("value", found if name in PROPERTIES else found(*arguments, **named)))
            except Exception as err:  # noqa: BLE001 - belongs to the action in the other process
                self._pipe.send(("error", err))


def apart(kind: str, made: list[ApartRepertoire]) -> MakeRepertoire:
    """Return a maker of repertoires in their own processes; each is put into `made`, to be closed."""

    def make(hardware: Hardware, targets: Targets, tracker: str = "") -> Repertoire:
        made.append(ApartRepertoire(kind, hardware, targets, tracker))
        return made[-1]

    return make


# ---- the child


@dataclass(frozen=True)
class _Wanted:
    """Something of the hardware that takes time: what an action waits for."""

    name: str
    arguments: Sequence[Any]
    named: Mapping[str, Any]


class _ServedHardware:
    """See `Hardware`; each member is asked of the other end of the pipe."""

    def __init__(self, pipe: Connection, profile: RoverProfile) -> None:
        self._pipe = pipe
        self.profile = profile

    def __getattr__(self, name: str) -> Any:
        if name in PROPERTIES:
            return self._call(name)
        if name in TAKES_TIME:
            return self._doing(name)
        return lambda *arguments, **named: self._call(name, *arguments, **named)

    def _call(self, name: str, *arguments: Any, **named: Any) -> Any:
        self._pipe.send(("call", name, arguments, named))
        kind, value = self._pipe.recv()
        if kind == "error":
            raise value
        return value

    @staticmethod
    def _doing(name: str) -> Callable[..., Generator[_Wanted, Any, Any]]:
        def doing(*arguments: Any, **named: Any) -> Generator[_Wanted, Any, Any]:
            return (yield _Wanted(name, arguments, named))

        return doing


class _NoWorld:
    """An import hook under which the simulated world does not exist."""

    def find_spec(self, name: str, *_: object) -> ModuleSpec | None:
        if name == WORLD or name.startswith(f"{WORLD}."):
            raise ModuleNotFoundError(f"{name} is not to be had where behaviour runs apart", name=name)
        return None


def _serve(pipe: Connection) -> None:
    """Carry out actions until told to quit."""
    own: Repertoire | None = None
    actions: dict[int, Generator[Any, Any, Any]] = {}
    while True:
        match pipe.recv():
            case ("make", kind, profile, targets, tracker):
                hardware = cast("Hardware", _ServedHardware(pipe, load_profile(profile)))
                own = KINDS[kind](hardware, targets, tracker)
                pipe.send(("answer",))
            case ("act", number, command) if own is not None:
                action = own.act(command)
                if action is not None:
                    actions[number] = cast("Generator[Any, Any, Any]", action)
                pipe.send(("answer", action is not None))
            case ("go", number, (kind, value)):
                pipe.send(("answer", *_gone_on(actions, number, kind, value)))
            case ("close", number):
                actions.pop(number).close()
                pipe.send(("answer",))
            case ("quit",):
                pipe.send(("answer", [name for name in sys.modules if name.startswith(WORLD)]))
                return


def _gone_on(actions: dict[int, Generator[Any, Any, Any]], number: int, kind: str, value: Any) -> Message:
    """Let an action go on to the next thing that takes time, and return that or how it ended."""
    action = actions[number]
    try:
        wanted: _Wanted = action.throw(value) if kind == "error" else action.send(value)
    except StopIteration as stop:
        del actions[number]
        return "done", stop.value
    except Exception as err:  # noqa: BLE001 - the other end has the wall
        del actions[number]
        return "raised", err
    return "doing", wanted.name, wanted.arguments, wanted.named


if __name__ == "__main__":
    sys.meta_path.insert(0, _NoWorld())
    _serve(Connection(int(sys.argv[1])))
