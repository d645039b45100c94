"""Driving commands of a rover on terrain: `navigate`, stop and go with the navigator, and `turn`."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Generator

import numpy as np

from executive.ports import Command, Value
from rover_iface.behaviour.action import Action, Outcome, Step, number
from rover_iface.behaviour.following import TargetFollower
from rover_iface.behaviour.hardware import Hardware
from rover_iface.behaviour.motion_watch import MotionWatch
from rover_iface.behaviour.products import png
from rover_iface.behaviour.sight import Sight
from rover_iface.behaviour.stands import Stands
from rover_iface.cameras.model import Array
from rover_iface.frames import Pose, wrap_angle
from rover_iface.navigation.navigator import Navigator, Progress, Way
from rover_iface.telemetry import TrackState

STUCK, HAZARD = "wheel stuck", "hazard"
"""What is told of a drive that a wheel stopped, and how it begins of one that touched something."""
NEAR_M = 1.2
ARRIVED_M, SHUT_OUT_M = 0.35, 1.0
"""Distance from the goal at which a rover that is led off again, or after many looks gets no nearer, has
arrived: the arm says if it reaches, and what move would help."""
FARTHER_M = 0.02
"""By how much a look farther from the goal than an earlier one tells that it gets no nearer."""
RETREATS, RETREAT_M, TRIES = 2, 0.2, 3
"""How often, how far and in how many tries a rover backs off what it touches in the last metre: a way that
begins in touch ends after its first few centimetres."""
FACING_SHARE = 0.9
"""Of the mast's pan: what lies farther round is turned to before it is looked at for the first time."""
SHORTEST_M = 0.02
"""Shifts shorter than this are turns only."""
LOOKS, LOOKS_PER_M = 12, 1.0
"""Looks that bring a drive no nearer to its goal before it is given up, and how many more for each metre that
was left at best. Of 318 drives that arrived 315 needed 12 at most; with 5 a metre 16 others went on for an
hour, and ten days of a hundred ended before their plan did (`docs/results/predicted-days.md`)."""
SOON = 3
"""Looks that bring a drive no nearer after which a stand that proves closed is given up: one that still gets
nearer may yet arrive beside it."""
RETRACES, RETRACE_M, TRAIL = 3, 0.5, 40
"""How often a rover that sees no safe path goes back in its own tracks, how far each time, and how many of
its last stops it remembers."""


class Driving:
    """Drives, and has its targets looked at after each way."""

    def __init__(self, hardware: Hardware, sight: Sight, follower: TargetFollower) -> None:
        self.hardware = hardware
        self.sight = sight
        self.follower = follower
        self._navigator: Navigator | None = None
        self._watch = MotionWatch()
        self._retreats = 0
        self._trail: deque[Pose] = deque(maxlen=TRAIL)
        self.stands = Stands(hardware, sight, follower)

    def turn(self, command: Command) -> Action:
        """Carry out `turn`."""
        if "heading" in command.parameters:
            angle = wrap_angle(number(command, "heading", 0.0) - self.hardware.believed.heading)
        else:
            angle = number(command, "angle", 0.0)
        before = self.hardware.drawn_j
        reason = yield from self._go(Way(angle, 0.0, 0.0))
        return Outcome(not reason, reason, {"energy_j": self.hardware.drawn_j - before})

    def face(self, point: Array) -> Generator[Step, None, str]:
        """Turn in place as far as it takes for the mast to look at a believed point (3,), site frame, m.

        Returns why it went wrong, or an empty string.
        """
        here = self.hardware.believed
        bearing = wrap_angle(math.atan2(point[1] - here.y, point[0] - here.x) - here.heading)
        beyond = abs(bearing) - FACING_SHARE * self.hardware.profile.mast.pan_limit_rad
        if beyond <= 0.0:
            return ""
        trouble = yield from self._go(Way(math.copysign(beyond, bearing), 0.0, 0.0))
        yield from self.follower.update_all()
        self.follower.set_ranges()
        self.hardware.report()
        return trouble

    def shift(self, pose: Pose) -> Generator[Step, None, str]:
        """Move to a near pose of the believed frame by turn, drive and turn, without a look.

        The targets are looked at at its end. Returns why it went wrong, or an empty string.
        """
        trouble = yield from self._straight_to(pose)
        if trouble:
            return trouble
        trouble = yield from self._go(
            Way(wrap_angle(pose.heading - self.hardware.believed.heading), 0.0, 0.0)
        )
        yield from self.follower.update_all()
        self.follower.set_ranges()
        self.hardware.report()
        return trouble

    def _straight_to(self, pose: Pose) -> Generator[Step, None, str]:
        """Turn, and drive forwards or backwards, to a near place; return why it went wrong, or nothing."""
        here = self.hardware.believed
        east, north = pose.x - here.x, pose.y - here.y
        length = math.hypot(east, north)
        if length < SHORTEST_M:
            return ""
        bearing = wrap_angle(math.atan2(north, east) - here.heading)
        turn = bearing if abs(bearing) <= math.pi / 2 else wrap_angle(bearing + math.pi)
        return (yield from self._go(Way(turn, 0.0, length if turn == bearing else -length)))

    def _retraced(self) -> Generator[Step, None, bool]:
        """Go back in the rover's own tracks: what carried it carries it again, whatever a look makes of it.

        Returns whether it came anywhere.
        """
        begin_m, trail = self.hardware.travelled_m, list(self._trail)
        self._trail.clear()
        while trail and self.hardware.travelled_m - begin_m < RETRACE_M:
            if (yield from self._straight_to(trail.pop())):
                break
        self._trail.clear()
        self._trail.extend(trail)
        return self.hardware.travelled_m - begin_m > SHORTEST_M

    def navigate(self, command: Command) -> Action:
        """Carry out `navigate`."""
        name = str(command.parameters.get("target", ""))
        if name and name not in self.follower.targets:
            return Outcome(False, f"unknown target {name}")
        self.follower.leave_refused(name)
        required = command.parameters.get("require_tracked") is True
        if (
            required
            and self.follower.state(name) is not TrackState.TRACKED
            and self.follower.targets[name].kind == "place"
        ):
            return Outcome(False, f"target {name} is not tracked")
        mode = str(command.parameters.get("mode", "track" if self.follower.alive() else "avoid"))
        begin_j, begin_m = self.hardware.drawn_j, self.hardware.travelled_m
        goal, heading = self._goal(command, name)
        self._navigator = None
        self._watch = MotionWatch()
        self.stands.begin()
        stood = "" if number(command, "standoff_m", 0.0) > 0.0 else name
        progress, looks = _patience(), 0
        retraces = 0
        self._retreats = 0
        nearest_m = math.inf
        reason = "too many looks"
        while looks < 150:
            goal, heading = self._goal(command, name)
            here = self.hardware.believed
            left = math.hypot(goal[0] - here.x, goal[1] - here.y)
            tolerance = 0.08 if name else 0.25
            # what lies in the way of the last decimetres would lead it off again
            near_enough = self._retreats > 0 or left > nearest_m + FARTHER_M
            if left <= (ARRIVED_M if near_enough else tolerance):
                reason = ""
                break
            nearest_m = min(nearest_m, left)
            stalled = progress.stalled(left)
            shut_out = left > SHUT_OUT_M and (stalled or (progress.waited >= SOON and self._closed(stood)))
            if stood and progress.waited and left > SHUT_OUT_M:
                yield from self.stands.note(stood)
            if stood and shut_out and (yield from self._stand_elsewhere(stood)):
                progress, nearest_m = _patience(), math.inf
                continue
            if stalled:
                reason = (
                    "" if left <= SHUT_OUT_M else f"no nearer than {progress.nearest_m:.2f} m to the goal"
                )
                break
            looks += 1
            way: Way | None
            if mode == "blind":
                way = self._straight(goal, left)
            else:
                way = yield from self._look_and_choose(goal, name)
            if way is None:
                retraces += 1
                if retraces <= RETRACES and (yield from self._retraced()):
                    continue
                reason = "no safe path"
                break
            trouble = yield from self._advance(way, left)
            if trouble:
                reason = trouble
                break
            if mode == "track":
                # where the targets are to be looked for, the ground tells
                yield from self._look(goal)
                yield from self._look_at_targets()
                reason = self._lost(name) if required else ""
                if reason:
                    break
                reason = "too many looks"
            self.follower.set_ranges()
            self.hardware.report()
        if not reason and heading is not None:
            reason = yield from self._turn_to(heading, name, looks_at_targets=mode == "track")
        self.follower.set_ranges()
        self.follower.write_views(command)
        self._write_products(command, goal)
        here = self.hardware.believed
        values: dict[str, Value] = {
            "distance_m": self.hardware.travelled_m - begin_m,
            "energy_j": self.hardware.drawn_j - begin_j,
            "error_m": math.hypot(goal[0] - here.x, goal[1] - here.y),
        }
        return Outcome(not reason, reason, values)

    def _turn_to(self, heading: float, name: str, *, looks_at_targets: bool) -> Generator[Step, None, str]:
        """Turn in place to a heading, rad; return why it went wrong, or an empty string.

        A touch ends no drive to a target, if it is named: there the arm says if it reaches, and what move
        would help.
        """
        angle = wrap_angle(heading - self.hardware.believed.heading)
        if abs(angle) <= math.radians(3):
            return ""
        trouble = yield from self._advance(Way(angle, 0.0, 0.0), 0.0)
        if name and trouble.startswith(HAZARD):
            trouble = ""
        if not trouble and looks_at_targets:
            yield from self.follower.update_all()
        return trouble

    def _closed(self, name: str) -> bool:
        """Return whether the ground seen by now forbids the stand of a target, if it is named."""
        return bool(name) and self._navigator is not None and self.stands.closed(name, self._navigator)

    def _stand_elsewhere(self, name: str) -> Generator[Step, None, bool]:
        """Choose another stand for a target; return whether there is one."""
        return self._navigator is not None and (yield from self.stands.choose(name, self._navigator))

    def _look_at_targets(self) -> Generator[Step, None, None]:
        """Look at the targets; a rover that was found elsewhere forgets what it has made of the ground."""
        corrections = self.follower.corrections
        yield from self.follower.update_all()
        if self.follower.corrections != corrections:
            self._navigator, self._watch = None, MotionWatch()
            self._trail.clear()

    def _lost(self, name: str) -> str:
        """Return why a drive to a target cannot go on, or an empty string."""
        state = self.follower.state(name)
        if self.follower.pose_lost and state is not TrackState.TRACKED:
            return f"the rover does not recognise where it stands: {self.follower.pose_lost}"
        return f"target {name} was lost" if state is TrackState.FAILED else ""

    def _advance(self, way: Way, left_m: float) -> Generator[Step, None, str]:
        """Drive one way; what it touches in the last metre (mostly what it came to) it backs off."""
        trouble = yield from self._go(way)
        if trouble.startswith(HAZARD) and left_m <= NEAR_M and self._retreats < RETREATS:
            self._retreats += 1
            for _ in range(TRIES):
                trouble = yield from self._go(Way(0.0, 0.0, -RETREAT_M))
                if not trouble.startswith(HAZARD):
                    break
        return trouble

    def _go(self, way: Way) -> Generator[Step, None, str]:
        """Drive one way; return why it went wrong, or an empty string."""
        if way.length_m:
            self._trail.append(self.hardware.believed)
        driven = yield from self.hardware.drive(way)
        if driven.hazard:
            return f"{HAZARD}: {driven.hazard}"
        return STUCK if driven.stuck else ""

    def _straight(self, goal: tuple[float, float], left: float) -> Way:
        here = self.hardware.believed
        turn = wrap_angle(math.atan2(goal[1] - here.y, goal[0] - here.x) - here.heading)
        return Way(turn if abs(turn) > 0.02 else 0.0, 0.0, min(left, self.hardware.profile.mobility.step_m))

    def _look(self, goal: tuple[float, float]) -> Generator[Step, None, Navigator]:
        """Look at the ground, and return what has it; the map of targets learns of the way here by it."""
        here = self.hardware.believed
        if self._navigator is None:
            self._navigator = Navigator.fresh(self.hardware.profile, (here.x, here.y), goal)
        navigator = self._navigator
        first = navigator.map.updates == 0
        looks = self.sight.cost(around=first)
        navigator.look(self.sight.look(around=first), self.sight.eye, here)
        view = self.sight.ahead()
        if view is not None:
            self._watch.see(view, here)
        yield from self.hardware.spend("navigator_step", looks)
        if navigator.way is not None:
            self.follower.came(navigator.way)
        return navigator

    def _look_and_choose(self, goal: tuple[float, float], name: str) -> Generator[Step, None, Way | None]:
        here, navigator = self.hardware.believed, self._navigator
        if navigator is None or navigator.looked_from != here:
            navigator = yield from self._look(goal)
        navigator.step_m = self._step_limit()
        if name:
            x, y = self.follower.position(name)[:2]
            navigator.ignore = (*navigator.on_map(float(x), float(y)), 0.45)
        places = [followed.update.position for followed in self.follower.followed.values()]
        navigator.keep_off = [navigator.on_map(float(x), float(y)) for x, y, _ in places]
        pose = navigator.where(here)
        way = navigator.choose(pose, navigator.on_map(*goal))
        return navigator.look_aside(pose) if way is None and not navigator.given_up else way

    def _step_limit(self) -> float:
        """Return the longest way the tracker can follow: a share of the nearest tracked target's range."""
        step = self.hardware.profile.mobility.step_m
        here = self.hardware.believed
        for followed in self.follower.alive():
            away = math.hypot(*(followed.update.position[:2] - (here.x, here.y)))
            step = min(step, max(0.25, 0.2 * away))
        return step

    def _goal(self, command: Command, name: str) -> tuple[tuple[float, float], float | None]:
        """Return where to drive in the believed frame, and the heading to end with."""
        heading = number(command, "heading", math.nan)
        wanted = None if math.isnan(heading) else heading
        standoff = number(command, "standoff_m", 0.0)
        here = self.hardware.believed
        if not name:
            x, y = number(command, "x", here.x), number(command, "y", here.y)
            away = math.hypot(x - here.x, y - here.y)
            share = max(0.0, 1.0 - standoff / away) if away > 0 else 0.0
            return (here.x + share * (x - here.x), here.y + share * (y - here.y)), wanted
        now = np.asarray(self.follower.position(name)[:2], dtype=float)
        stand = self.stands.of(name)
        if stand is None or standoff > 0:
            away = math.hypot(now[0] - here.x, now[1] - here.y)
            reach = standoff if standoff > 0 else 0.9
            share = max(0.0, 1.0 - reach / away) if away > 0 else 0.0
            face = math.atan2(now[1] - here.y, now[0] - here.x)
            return (
                (here.x + share * (now[0] - here.x), here.y + share * (now[1] - here.y)),
                face if wanted is None else wanted,
            )
        return (stand.x, stand.y), stand.heading if wanted is None else wanted

    def _write_products(self, command: Command, goal: tuple[float, float]) -> None:
        """Write the hazard map, the odometry, the tracking history and the visual odometry of a drive."""
        if not self.hardware.keeps_products:
            return
        here = self.hardware.believed
        if self._navigator is not None:
            picture = self._navigator.map.picture(16.0, (here.x, here.y))
            label = {"frame": "site", "size_m": 16.0, "goal_m": list(goal)}
            self.hardware.write_product(command, "hazardmap", png(picture), ".png", label)
        for kind in ("odometry", "tracking"):
            self.hardware.write_log(command, kind)
        if self._watch.rows:
            label = {"frame": "rover", "rows": len(self._watch.rows), "slipped": self._watch.slipped}
            self.hardware.write_product(command, "visualodometry", self._watch.table(), ".json", label)


def _patience() -> Progress:
    return Progress(NEAR_M, far_patience=LOOKS, looks_per_m=LOOKS_PER_M)
