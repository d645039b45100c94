"""What every rover owes the executive, as checks that can be run against any of them.

`outcrop rover check NAME` runs them, and so do the tests for each rover that comes with the program. A check
gets a
fresh rover in a small flat world with two targets, drives it through the port alone, and says what it found
wrong.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from executive.crl.dictionary import Dictionary, ValueSpec, ValueType
from executive.ports import (
    Acknowledgement,
    Command,
    CommandId,
    CommandState,
    Event,
    Product,
    Result,
    Rover,
    Update,
    Value,
)
from rover_iface.profile import RoverProfile, load_profile

Factory = Callable[..., Rover]


@dataclass(frozen=True, slots=True)
class Finding:
    """One check and its outcome; `detail` says what was wrong, or is empty."""

    name: str
    detail: str = ""

    @property
    def passed(self) -> bool:
        """Return whether nothing was wrong."""
        return not self.detail


@dataclass(frozen=True)
class Case:
    """What the checks are about: how a fresh rover is made, and what it is by its profile."""

    rover: Callable[[], Rover]
    profile: RoverProfile
    dictionary: Dictionary

    def parameters(self, action: str) -> dict[str, Value]:
        """Return parameters of an action as its dictionary wants them, for the target T1."""
        spec = self.dictionary.commands.actions[action]
        group = spec.one_of[0] if spec.one_of else ()
        return {
            p.name: "T1" if p.name == "target" else _example(p)
            for p in spec.parameters
            if p.required or p.name in group
        }


def _example(spec: ValueSpec) -> Value:
    if spec.type is ValueType.STRING:
        return spec.choices[0] if spec.choices else "T1"
    return False if spec.type is ValueType.BOOLEAN else max(spec.minimum or 0.0, 0.0)


class _BrokenError(Exception):
    """What a check found wrong."""


def write_contract_world(folder: Path, profile: str = "k9") -> Path:
    """Write the world of the checks (`world.json` and its terrain) for a rover profile; return the folder."""
    from rover_iface.terrain.grid import HeightLayer
    from rover_iface.terrain.load import write_terrain
    from rover_iface.terrain.strew import add_rocks
    from rover_iface.terrain.terrain import Terrain

    axis = np.arange(-14.0, 14.0 + 1e-9, 0.1)
    x, y = np.meshgrid(axis, axis)
    heights = (0.03 * np.sin(0.7 * x) * np.cos(0.6 * y)).astype(np.float32)
    flat = Terrain("contract", (HeightLayer(heights, -14.0, -14.0, 0.1),), credits="Made by a formula")
    ground = add_rocks(flat, np.array([[4.0, 0.6, 0.5], [4.5, -2.5, 0.6]]), seed=3, prefix="R")
    write_terrain(ground, folder / "terrain")
    targets = []
    for number, rock in enumerate(ground.rocks, start=1):
        targets.append(_target(f"T{number}", ground, rock))
    world = {
        "format": "world/1",
        "name": "contract",
        "terrain": "terrain",
        "profile": profile,
        "seed": 7,
        "targets": targets,
    }
    (folder / "world.json").write_text(json.dumps(world, indent=1) + "\n", encoding="utf-8")
    return folder


def _target(name: str, ground: Any, rock: Any) -> dict[str, Any]:
    bearing = math.atan2(-rock.y, -rock.x)
    x = rock.x + 0.25 * rock.diameter * math.cos(bearing)
    y = rock.y + 0.25 * rock.diameter * math.sin(bearing)
    return {
        "id": name,
        "point_m": [x, y, ground.height_at(x, y)],
        "observation_point": {
            "east_m": x + 0.9 * math.cos(bearing),
            "north_m": y + 0.9 * math.sin(bearing),
            "heading_rad": bearing + math.pi,
        },
    }


class _Driver:
    """Talks to one rover and keeps what it heard."""

    def __init__(self, rover: Rover) -> None:
        self.rover = rover
        self.heard: list[Event] = []
        self.state: dict[str, Value] = {}
        self.now = 0
        self._count = 0

    def hear(self, until_ms: int | None) -> Event | None:
        event = self.rover.next_event(until_ms)
        if event is None:
            if until_ms is not None:
                self.now = max(self.now, until_ms)
            return None
        if event.t_ms < self.now:
            raise _BrokenError(f"an event of {event.t_ms} ms came after the clock had reached {self.now} ms")
        if until_ms is not None and event.t_ms > until_ms:
            raise _BrokenError(f"asked for events until {until_ms} ms, an event of {event.t_ms} ms came")
        self.now = event.t_ms
        self.heard.append(event)
        if isinstance(event, Update):
            self.state.update(event.values)
        elif isinstance(event, Result | Acknowledgement):
            self.state.update(event.updates)
        return event

    def begin(self) -> None:
        while self.hear(0) is not None:
            pass

    def send(self, action: str, **parameters: Value) -> CommandId:
        self._count += 1
        command = Command(CommandId("contract", f"{action}-{self._count}", 1), action, parameters)
        self.rover.send(command)
        return command.id

    def answer(self, command: CommandId) -> Result | Acknowledgement:
        for _ in range(100_000):
            event = self.hear(None)
            if event is None:
                raise _BrokenError(f"{command.task} never gave a result")
            if isinstance(event, Result | Acknowledgement) and event.command == command:
                return event
        raise _BrokenError(f"{command.task} gave 100,000 events and no result")

    def do(self, action: str, **parameters: Value) -> Result:
        answer = self.answer(self.send(action, **parameters))
        if not isinstance(answer, Result):
            raise _BrokenError(f"{action} was acknowledged as aborted without an abort")
        return answer


def _need(condition: bool, detail: str) -> None:
    if not condition:
        raise _BrokenError(detail)


# ---- the checks


def _tells_its_state_at_time_zero(case: Case) -> None:
    driver = _Driver(case.rover())
    event = driver.hear(0)
    _need(
        isinstance(event, Update) and event.t_ms == 0, f"the first event is {event!r:.80}, not an update at 0"
    )
    driver.begin()
    for key in ("battery-energy", "energy-used", "pose x", "pose y", "pose heading", "trackerstate T1"):
        _need(key in driver.state, f'the state at time 0 lacks ":{key}"')


def _waits_exactly_and_once(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    rover = driver.rover
    command = Command(CommandId("contract", "w", 1), "wait", {"duration_s": 5.25})
    _need(rover.status(command.id).state is CommandState.UNKNOWN, "a command never sent is not unknown")
    rover.send(command)
    rover.send(command)
    _need(
        rover.status(command.id).state is CommandState.RUNNING, "a wait of 5.25 s does not run after sending"
    )
    result = driver.answer(command.id)
    _need(result.t_ms == 5250, f"a wait of 5.25 s ended at {result.t_ms} ms")
    _need(isinstance(result, Result) and result.success, "a wait failed")
    rover.send(command)
    again = driver.hear(60_000)
    while again is not None:
        _need(not isinstance(again, Result), "a repeat of a command id was carried out again")
        again = driver.hear(60_000)
    status = rover.status(command.id)
    _need(
        status.state is CommandState.DONE and status.result == result, "status does not give the result again"
    )


def _refuses_what_it_does_not_know(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    for action, parameters in (
        ("dance", {}),
        ("navigate", {}),
        ("navigate", {"target": "T-unknown"}),
        ("trackstart", {"target": "T-unknown"}),
    ):
        result = driver.do(action, **parameters)
        _need(not result.success, f"{action} {parameters} succeeded")
        _need(bool(result.reason), f"{action} {parameters} failed without a reason")


def _acknowledges_an_abort(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    command = driver.send("wait", duration_s=1000.0)
    while driver.hear(20_000) is not None:
        pass
    driver.rover.abort(command)
    answer = driver.answer(command)
    _need(isinstance(answer, Acknowledgement), "an aborted wait gave a result instead of an acknowledgement")
    _need(answer.t_ms >= 20_000, "the acknowledgement is earlier than the abort")
    state = driver.rover.status(command)
    _need(state.state is CommandState.DONE, "an aborted command is not done")
    driver.rover.abort(command)
    after = driver.do("wait", duration_s=1.0)
    _need(after.success, "a wait after an abort failed")


def _does_two_things_at_once(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    longer, shorter = driver.send("wait", duration_s=20.0), driver.send("wait", duration_s=10.0)
    first, second = driver.answer(shorter), driver.answer(longer)
    _need(
        (first.t_ms, second.t_ms) == (10_000, 20_000),
        f"waits of 10 and 20 s ended at {first.t_ms}, {second.t_ms}",
    )


def _uses_energy_that_never_comes_back(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    used = [driver.state.get("energy-used", 0.0)]
    for seconds in (10.0, 0.0, 100.0):
        driver.do("wait", duration_s=seconds)
        used.append(driver.state["energy-used"])
    numbers = [float(v) for v in used if isinstance(v, int | float)]
    _need(len(numbers) == len(used), f'":energy-used" is not a number: {used}')
    _need(numbers == sorted(numbers), f'":energy-used" fell: {numbers}')


def _drives_and_tells_where_it_is(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    result = driver.do("navigate", x=1.5, y=0.5)
    _need(result.success, f"a drive of 1.6 m over level ground failed: {result.reason}")
    away = math.hypot(float(driver.state["pose x"]) - 1.5, float(driver.state["pose y"]) - 0.5)
    _need(away < 0.5, f"a drive to (1.5, 0.5) ended {away:.2f} m from it")
    _need(result.t_ms > 1000, "a drive of 1.6 m took no time")


def _tracks_or_says_why_not(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    result = driver.do("trackstart", target="T1")
    state = driver.state.get("trackerstate T1")
    if result.success:
        _need(state == "tracked", f"tracking was started, its state is {state}")
        confidence = driver.state.get("trackerconfidence T1")
        _need(isinstance(confidence, float) and 0 <= confidence <= 1, f"confidence is {confidence}")
        driver.do("trackstop", target="T1")
        _need(driver.state.get("trackerstate T1") == "idle", "a stopped tracker is not idle")
    else:
        _need(bool(result.reason), "tracking failed without a reason")
    _need(driver.do("trackstop", target="T1").success, "stopping what is not tracked failed")


def _will_not_leave_without_the_track(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    result = driver.do("navigate", target="T1", require_tracked=True)
    _need(not result.success, "it left for a target that must be tracked and is not")
    _need(result.t_ms == 0, f"it took {result.t_ms} ms to see that the target is not tracked")


def _knows_every_action_of_its_dictionary(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    for action in case.dictionary.commands.actions:
        command = driver.send(action, **case.parameters(action))
        driver.rover.abort(command)
        answer = driver.answer(command)
        reason = answer.reason if isinstance(answer, Result) else ""
        _need(not reason.startswith("unknown action"), f"{action} is in the dictionary: {reason}")


def _visits_a_target_and_keeps_to_its_dictionaries(case: Case) -> None:
    driver = _Driver(case.rover())
    driver.begin()
    driver.do("trackstart", target="T1")
    driver.do("navigate", target="T1")
    for name, figures in case.profile.instruments.items():
        driver.do(figures.used_by, target="T1", instrument=name)
    commands, telemetry = case.dictionary.commands, case.dictionary.telemetry
    if "image" in commands.actions:
        driver.do("image", azimuth=0.0, elevation=-0.3)
    if "stow" in commands.actions:
        driver.do("stow")
    results = {action.name: {v.name: v for v in action.results} for action in commands.actions.values()}
    for event in driver.heard:
        values = event.values if isinstance(event, Update) else getattr(event, "updates", {})
        for key, value in values.items():
            name, *arguments = key.split(" ")
            spec = telemetry.keys.get(name)
            _need(spec is not None, f'":{key}" is not in the telemetry dictionary')
            assert spec is not None
            _need(len(arguments) == telemetry.arguments[name], f'":{key}" has {len(arguments)} arguments')
            _fits(spec, value, f'":{key}"')
        if isinstance(event, Result):
            action = event.command.task.rsplit("-", 1)[0]
            for name, value in event.values.items():
                spec = results[action].get(name)
                _need(spec is not None, f'result "{name}" of {action} is not in the command dictionary')
                assert spec is not None
                _fits(spec, value, f'result "{name}" of {action}')
        if isinstance(event, Product):
            _need(len(event.sha256) == 64, f"product {event.path} has no SHA-256")


def _fits(spec: ValueSpec, value: Value, what: str) -> None:
    kind = {ValueType.NUMBER: (int, float), ValueType.STRING: (str,), ValueType.BOOLEAN: (bool,)}[spec.type]
    right = isinstance(value, kind) and (spec.type is ValueType.BOOLEAN or not isinstance(value, bool))
    _need(right, f"{what} is {value!r}, not a {spec.type}")
    if isinstance(value, int | float) and not isinstance(value, bool):
        _need(math.isfinite(value), f"{what} is {value}")
        _need(
            spec.minimum is None or value >= spec.minimum - 1e-9, f"{what} is {value}, below {spec.minimum}"
        )
        _need(
            spec.maximum is None or value <= spec.maximum + 1e-9, f"{what} is {value}, above {spec.maximum}"
        )
    if spec.choices:
        _need(value in spec.choices, f"{what} is {value!r}, not one of {', '.join(spec.choices)}")


def _does_the_same_for_the_same_seed(case: Case) -> None:
    days = []
    for _ in range(2):
        driver = _Driver(case.rover())
        driver.begin()
        driver.do("trackstart", target="T2")
        driver.do("navigate", x=1.0, y=-0.6)
        driver.do("imagepanorama")
        days.append([e for e in driver.heard if not isinstance(e, Product)])
    _need(days[0] == days[1], "two rovers with the same seed did not do the same")


CHECKS: tuple[Callable[[Case], None], ...] = (
    _tells_its_state_at_time_zero,
    _waits_exactly_and_once,
    _refuses_what_it_does_not_know,
    _acknowledges_an_abort,
    _does_two_things_at_once,
    _uses_energy_that_never_comes_back,
    _drives_and_tells_where_it_is,
    _tracks_or_says_why_not,
    _will_not_leave_without_the_track,
    _knows_every_action_of_its_dictionary,
    _visits_a_target_and_keeps_to_its_dictionaries,
    _does_the_same_for_the_same_seed,
)


def check_rover(
    factory: Factory, world: Path, *, dictionary: Dictionary | None = None, **options: Any
) -> list[Finding]:
    """Return what each check found for rovers made by `factory(world, **options)`.

    `world` is a folder as `write_contract_world` makes it; it names the profile. The dictionary is that of
    the profile unless another is given. An exception that a rover lets out is a finding too.
    """
    named = str(json.loads((world / "world.json").read_text(encoding="utf-8")).get("profile", "k9"))
    profile = load_profile(world / named if named.endswith(".toml") else named)
    case = Case(lambda: factory(world, **options), profile, dictionary or profile.language)
    findings = []
    for check in CHECKS:
        name = check.__name__.strip("_").replace("_", " ")
        try:
            check(case)
        except _BrokenError as err:
            findings.append(Finding(name, str(err)))
        except Exception as err:  # noqa: BLE001 - whatever a rover raises is its finding
            findings.append(Finding(name, f"raised {type(err).__name__}: {err}"))
        else:
            findings.append(Finding(name))
    return findings
