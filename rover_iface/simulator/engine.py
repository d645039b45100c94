"""What all simulated rovers share: a virtual clock, running actions, telemetry, aborts, products and faults.

An action is a generator that yields `Step`s (so long, so much energy, along this way) and returns an
`Outcome`.
Between two steps the generator looks at the world and changes it, so that a slow action unfolds in time, can
be interrupted, and can run beside others.
"""

from __future__ import annotations

import hashlib
import heapq
import json
import logging
import math
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from executive.crl.dictionary import CommandDictionary
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
from rover_iface.behaviour.action import Action, Outcome, Route, Step
from rover_iface.frames import Pose, wrap_angle
from rover_iface.profile import standard_dictionary
from rover_iface.simulator.faults import Fault, FaultKind


def milliseconds(seconds: float) -> int:
    """Return whole milliseconds, the half rounded to even."""
    return round(seconds * 1000.0)


INTERNAL_ERROR = "internal-error"
"""Reason of an action that ended by an error in the rover's own program; its log has the traceback."""

logger = logging.getLogger(__name__)


@dataclass(slots=True)
class _Running:
    command: Command
    action: Action
    step: Step | None = None
    since_ms: int = 0
    token: int = 0
    silent: bool = False
    energy_j: float = 0.0


_RESUME, _FAULT, _PROGRESS = 0, 1, 2


class SimulatedRover:
    """A rover on a virtual clock, behind `executive.ports.Rover`. Subclasses say what each action does.

    Parameters
    ----------
    hotel_w
        Load that goes on whatever the rover does.
    battery_j
        Energy in the battery at the start.
    out
        Folder of the run, into which products are written; without it there are none.
    progress_s
        Report pose and energy so often during a drive; 0 = only with results, the fast way.
    progress_at_bends
        Report them not so often, but so long after a drive's begin, and at each bend and so long after it:
        what lies between two reports lies on the straight line between them.
    """

    def __init__(
        self,
        *,
        hotel_w: float,
        battery_j: float,
        pose: Pose,
        out: Path | None = None,
        progress_s: float = 0.0,
        progress_at_bends: bool = False,
        faults: Sequence[Fault] = (),
    ) -> None:
        self.hotel_w = hotel_w
        self.initial_j = battery_j
        self.charged_j = 0.0
        self.drawn_j = 0.0
        self.pose = pose
        self.out = out
        self.faults = tuple(faults)
        self._progress_ms = milliseconds(progress_s)
        self._progress_at_bends = progress_at_bends
        self._now = 0
        self._count = 0
        self._heap: list[tuple[int, int, int, Any]] = []
        self._ready: list[Event] = []
        self._running: dict[CommandId, _Running] = {}
        self._done: dict[CommandId, Result | Acknowledgement] = {}
        self._state: dict[str, Value] = {}
        self._fresh: dict[str, Value] = {}
        self._products = 0
        self._progress_at: int | None = None
        self.slow_factor = 1.0
        self.stuck_from_ms: int | None = None
        self.silent_from_ms: int | None = None
        self.camera_failed = False
        for fault in self.faults:
            if fault.at_s is not None:
                self._push(milliseconds(fault.at_s), _FAULT, fault)

    # ---- what a subclass gives

    @property
    def commands(self) -> CommandDictionary:
        """Return the actions that the rover takes."""
        return standard_dictionary().commands

    def act(self, command: Command) -> Action:
        """Return the generator of an action; the default answers that the action is unknown."""
        return self._unknown(command)

    def _unknown(self, command: Command) -> Action:
        yield from ()
        return Outcome(False, f"unknown action {command.action}")

    def lose_target(self, target: str, confidence: float = 0.1) -> None:
        """Make the tracker of a target lose it, by a fault."""

    # ---- clock and energy

    @property
    def now_ms(self) -> int:
        """Return the virtual clock, ms."""
        return self._now

    @property
    def t_s(self) -> float:
        """Return the virtual clock in seconds."""
        return self._now / 1000.0

    @property
    def energy_used_j(self) -> float:
        """Return the energy used since the start, parts of running steps included."""
        partial = 0.0
        for running in self._running.values():
            step = running.step
            if step is not None and step.energy_j and step.duration_ms:
                partial += step.energy_j * (self._now - running.since_ms) / step.duration_ms
        return self.drawn_j + partial + self.hotel_w * (self._now / 1000.0)

    @property
    def battery_j(self) -> float:
        """Return the energy left, at least 0."""
        return max(0.0, self.initial_j - self.energy_used_j + self.charged_j)

    # ---- telemetry

    def set(self, name: str, value: Value) -> None:
        """Set a state key; it is reported with the next result or update, if it has changed."""
        if self._state.get(name) != value:
            self._state[name] = value
            self._fresh[name] = value

    def get(self, name: str) -> Value | None:
        """Return the present value of a state key."""
        return self._state.get(name)

    def set_pose(self, pose: Pose) -> None:
        """Move the rover and the keys that follow from it."""
        self.pose = pose
        self.set("pose x", pose.x)
        self.set("pose y", pose.y)
        self.set("pose heading", pose.heading)

    def refresh(self) -> None:
        """Bring the keys that follow from the clock up to date; subclasses add theirs."""
        used = self.energy_used_j
        self.set("energy-used", used)
        self.set("battery-energy", max(0.0, self.initial_j - used + self.charged_j))

    def report(self) -> None:
        """Send what has changed as an update of its own."""
        self.refresh()
        values = self._take()
        if values:
            self._ready.append(Update(self._now, values))

    def _take(self) -> dict[str, Value]:
        values, self._fresh = self._fresh, {}
        return values

    # ---- command port

    def send(self, command: Command) -> None:
        """Start an action; a command id that was seen before is ignored."""
        if command.id in self._running or command.id in self._done:
            return
        while self._heap and self._heap[0][0] <= self._now and self._heap[0][2] == _FAULT:
            self.apply_fault(heapq.heappop(self._heap)[3])
        problem = check_command(command, self.commands)
        action = self._refuse(problem) if problem else self._walled(command)
        running = _Running(command, action)
        self._running[command.id] = running
        for fault in self.faults:
            if fault.task == command.id.task:
                if fault.kind is FaultKind.SILENT:
                    running.silent = True
                else:
                    self.apply_fault(fault)
        if self.silent_from_ms is not None and self._now >= self.silent_from_ms:
            running.silent = True
        self._advance(running)

    def _walled(self, command: Command) -> Action:
        """Carry out an action; an error in it ends it as failed and nothing else."""
        try:
            return (yield from self.act(command))
        except Exception as err:  # noqa: BLE001 - whatever a behaviour raises, the plan goes on by its branches
            self._log_error(command, err)
            return Outcome(False, INTERNAL_ERROR)

    def _log_error(self, command: Command, err: Exception) -> None:
        """Put the traceback of an error into the log, and into `rover.log` of the run's folder."""
        logger.error(
            "internal error in an action",
            extra={"task_id": command.id.task, "action": command.action, "t_s": self.t_s},
            exc_info=err,
        )
        if self.out is None:
            return
        self.out.mkdir(parents=True, exist_ok=True)
        told = "".join(traceback.format_exception(err))
        with (self.out / "rover.log").open("a", encoding="utf-8") as file:
            file.write(f"{self.t_s:.3f} s, {command.action} of task {command.id.task}:\n{told}\n")

    def _refuse(self, problem: str) -> Action:
        yield from ()
        return Outcome(False, problem)

    def abort(self, command: CommandId) -> None:
        """Stop a running action where it is; the acknowledgement comes at the same time stamp."""
        stopped = self._running.pop(command, None)
        if stopped is None:
            return
        self._settle(stopped)
        stopped.action.close()
        self.interrupted(stopped.command)
        self.refresh()
        done = Acknowledgement(self._now, command, self._take())
        self._done[command] = done
        self._ready.append(done)

    def interrupted(self, command: Command) -> None:
        """Tidy up after an aborted action; called when its partial step has been charged."""

    def status(self, command: CommandId) -> CommandStatus:
        """Return what became of a command."""
        if command in self._running:
            return CommandStatus(CommandState.RUNNING)
        if command in self._done:
            return CommandStatus(CommandState.DONE, self._done[command])
        return CommandStatus(CommandState.UNKNOWN)

    # ---- event source

    def next_event(self, until_ms: int | None) -> Event | None:
        """Return the next event up to a time and move the clock there; see `executive.ports.EventSource`."""
        while True:
            if self._ready:
                if until_ms is not None and self._ready[0].t_ms > until_ms:
                    return None
                return self._ready.pop(0)
            if not self._heap:
                if until_ms is not None and until_ms > self._now:
                    self._now = until_ms
                return None
            at, _, kind, what = self._heap[0]
            if until_ms is not None and at > until_ms:
                self._now = max(self._now, until_ms)
                return None
            heapq.heappop(self._heap)
            if kind == _RESUME:
                resumed: _Running = what[0]
                if resumed.token != what[1] or self._running.get(resumed.command.id) is not resumed:
                    continue
                self._now = max(self._now, at)
                self._advance(resumed)
            elif kind == _PROGRESS:
                if self._running:
                    self._now = max(self._now, at)
                self._progress()
            else:
                self._now = max(self._now, at)
                self.apply_fault(what)

    def _push(self, at_ms: int, kind: int, what: Any) -> None:
        self._count += 1
        heapq.heappush(self._heap, (at_ms, self._count, kind, what))

    # ---- actions

    def _settle(self, running: _Running) -> None:
        """Charge the step that is over or cut short, and move along its route."""
        step = running.step
        if step is None:
            return
        share = 1.0
        if step.duration_ms:
            share = min(1.0, (self._now - running.since_ms) / step.duration_ms)
        energy = step.energy_j if share >= 1.0 else step.energy_j * share
        running.energy_j += energy
        running.step = None
        self.drawn_j += energy
        if step.route:
            self.set_pose(along(self.pose, step.route, share))

    def _advance(self, running: _Running) -> None:
        """Let an action go on from the end of its step."""
        self._settle(running)
        if running.silent:
            running.token += 1
            return
        try:
            step = next(running.action)
        except StopIteration as stop:
            self._finish(running, stop.value)
            return
        running.step = step
        running.since_ms = self._now
        running.token += 1
        self._push(self._now + step.duration_ms, _RESUME, (running, running.token))
        if self._progress_ms and self._progress_at_bends:
            for after_ms in bends(step, self._progress_ms):
                self._push(self._now + after_ms, _PROGRESS, None)
        elif self._progress_ms and step.duration_ms > self._progress_ms and self._progress_at is None:
            self._progress_at = self._now + self._progress_ms
            self._push(self._progress_at, _PROGRESS, None)

    def _finish(self, running: _Running, outcome: Outcome) -> None:
        command = running.command
        del self._running[command.id]
        self.refresh()
        result = Result(self._now, command.id, outcome.success, outcome.reason, outcome.values, self._take())
        self._done[command.id] = result
        self._ready.append(result)

    def _progress(self) -> None:
        self._progress_at = None
        longest = 0
        for running in self._running.values():
            step = running.step
            if step is None:
                continue
            longest = max(longest, running.since_ms + step.duration_ms - self._now)
            if step.route and step.duration_ms:
                here = along(self.pose, step.route, (self._now - running.since_ms) / step.duration_ms)
                self.set("pose x", here.x)
                self.set("pose y", here.y)
                self.set("pose heading", here.heading)
        if longest <= 0:
            return
        self.set("heartbeat", self._now / 1000.0)
        self.report()
        if longest > self._progress_ms and not self._progress_at_bends:
            self._progress_at = self._now + self._progress_ms
            self._push(self._progress_at, _PROGRESS, None)

    # ---- faults

    def add_fault(self, fault: Fault) -> None:
        """Take a fault while the rover lives: at its time, at once if that has passed, or at its task."""
        self.faults = (*self.faults, fault)
        if fault.at_s is not None:
            self._push(max(self._now, milliseconds(fault.at_s)), _FAULT, fault)

    def apply_fault(self, fault: Fault) -> None:
        """Bring a fault into effect now."""
        kind = fault.kind
        if kind is FaultKind.LOSE_TARGET or kind is FaultKind.SHADOW:
            self.lose_target(fault.target, 0.1 if kind is FaultKind.LOSE_TARGET else 0.3)
            self.report()
        elif kind is FaultKind.SLOW_DRIVE or kind is FaultKind.SLIP_BURST:
            self.slow_factor = fault.strength
        elif kind is FaultKind.STUCK_WHEEL:
            self.stuck_from_ms = self._now
        elif kind is FaultKind.LOW_BATTERY:
            self.charged_j -= max(0.0, self.battery_j - fault.strength)
            self.report()
        elif kind is FaultKind.CAMERA_FAILURE:
            self.camera_failed = True
        elif kind is FaultKind.SILENT:
            self.silent_from_ms = self._now
            for running in self._running.values():
                running.silent = True
        elif kind is FaultKind.NOVELTY:
            self.set("novelty", fault.strength)
            self.report()

    # ---- products

    def write_product(
        self,
        command: Command,
        kind: str,
        data: bytes,
        suffix: str,
        label: Mapping[str, object],
    ) -> bool:
        """Write one data product and its label into the run's folder, and announce it; False without a
        folder.
        """
        if self.out is None:
            return False
        path = self.out / "products" / f"{self.product_stem(command, kind)}{suffix}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
        self.announce_product(command, kind, path, label)
        return True

    def product_stem(self, command: Command, kind: str) -> str:
        """Return the next name for a product, without suffix: number, task and kind."""
        self._products += 1
        safe = "".join(c if c.isalnum() or c in "-_." else "_" for c in command.id.task)
        return f"{self._products:04d}-{safe}-{kind}"

    def announce_product(self, command: Command, kind: str, path: Path, label: Mapping[str, object]) -> None:
        """Write the label of a file in the run's folder beside it, and announce the file as a product."""
        assert self.out is not None, "a product needs the folder of a run"
        data = path.read_bytes()
        digest = hashlib.sha256(data).hexdigest()
        whole: dict[str, Any] = {
            "format": "product/1",
            "kind": kind,
            "file": path.name,
            "sha256": digest,
            "t_s": self._now / 1000.0,
            "run": command.id.run,
            "task": command.id.task,
            "attempt": command.id.attempt,
            "action": command.action,
            "pose": {"frame": "site", **pose_label(self.pose)},
            **label,
        }
        for name_, value in command.metadata.items():
            whole.setdefault(name_, value)
        path.with_name(f"{path.name}.json").write_text(
            json.dumps(whole, indent=1, sort_keys=True) + "\n", encoding="utf-8"
        )
        flat = {k: v for k, v in whole.items() if isinstance(v, str | float | int | bool)}
        self._ready.append(
            Product(
                self._now,
                command.id,
                kind,
                path.relative_to(self.out).as_posix(),
                digest,
                {
                    k: float(v) if isinstance(v, int) and not isinstance(v, bool) else v
                    for k, v in flat.items()
                },
            )
        )


def pose_label(pose: Pose) -> dict[str, float]:
    """Return a pose as a product's label has it."""
    return {
        "east_m": pose.x,
        "north_m": pose.y,
        "up_m": pose.z,
        "heading_rad": pose.heading,
        "pitch_rad": pose.pitch,
        "roll_rad": pose.roll,
    }


def check_command(command: Command, commands: CommandDictionary) -> str:
    """Return what is wrong with a command by a dictionary, or an empty string."""
    spec = commands.actions.get(command.action)
    if spec is None:
        return f'unknown action "{command.action}"'
    known = {p.name for p in spec.parameters}
    for name in command.parameters:
        if name not in known:
            return f'{command.action}: unknown parameter "{name}"'
    for parameter in spec.parameters:
        if parameter.required and parameter.name not in command.parameters:
            return f'{command.action}: parameter "{parameter.name}" is missing'
    if spec.one_of and not any(all(n in command.parameters for n in group) for group in spec.one_of):
        groups = " or ".join(" and ".join(group) for group in spec.one_of)
        return f"{command.action}: {groups} is needed"
    return ""


def route_length(route: Route) -> float:
    """Return the length of a polyline, metres."""
    return sum(math.hypot(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(route))


def bends(step: Step, settled_ms: int) -> list[int]:
    """Return the times within a step, from its begin, between which its motion is even: `settled_ms` after it
    has begun, at each inner point of its route, and `settled_ms` after that.
    """
    whole = route_length(step.route)
    if not whole or not step.duration_ms:
        return []
    times, done = {settled_ms}, 0.0
    for part in list(pairwise(step.route))[:-1]:
        done += route_length(part)
        at = round(step.duration_ms * done / whole)
        times |= {at, at + settled_ms}
    return sorted(at for at in times if 0 < at < step.duration_ms)


def along(pose: Pose, route: Route, share: float) -> Pose:
    """Return the pose after a share (0 to 1) of a polyline, heading along it; z and attitude as they were."""
    if len(route) < 2:
        x, y = route[0] if route else (pose.x, pose.y)
        return Pose(x, y, pose.z, pose.heading, pose.pitch, pose.roll)
    left = share * route_length(route)
    heading = pose.heading
    for a, b in pairwise(route):
        length = math.hypot(b[0] - a[0], b[1] - a[1])
        if length > 0:
            heading = wrap_angle(math.atan2(b[1] - a[1], b[0] - a[0]))
        if left <= length and length > 0:
            f = left / length
            return Pose(
                a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), pose.z, heading, pose.pitch, pose.roll
            )
        left -= length
    x, y = route[-1]
    return Pose(x, y, pose.z, heading, pose.pitch, pose.roll)
