"""The expected utility of a plan whose times and energies are certain: every outcome, from the definition."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from planner.contest.instance import Instance


class Now(NamedTuple):
    """Where a run stands: time s, energy of actions J, place, tracks, observations done."""

    t: float = 0.0
    g: float = 0.0
    at: str = "start"
    tracked: frozenset[str] = frozenset()
    done: frozenset[str] = frozenset()


class Outcomes:
    """Follows each loss and success by itself, depth first."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance

    def value(self, steps: Sequence[Any], now: Now) -> float:
        """Return the expected utility of steps from here on."""
        if not steps or steps[0]["op"] == "stop":
            return 0.0
        step, rest = steps[0], steps[1:]
        if step["op"] == "branch":
            for option in step["options"]:
                if all(self.holds(condition, now) for condition in option["when"]):
                    return self.value(option["plan"], now)
            return self.value(rest, now)
        act = {"track_start": self.start, "track_stop": self.stop, "observe": self.observe}
        return act.get(step["op"], self.drive)(step, rest, now)

    def holds(self, condition: Any, now: Now) -> bool:
        """Return whether a condition holds."""
        if condition["var"] == "time_s":
            used = now.t
        elif condition["var"] == "energy_j":
            used = now.g + self.instance.hotel_w * now.t
        else:
            marks = now.tracked if condition["var"] == "tracked" else now.done
            return (condition["target"] in marks) == condition["is"]
        return used >= condition["ge"] if "ge" in condition else used < condition["lt"]

    def failed(self, step: Any, rest: Sequence[Any], now: Now) -> float:
        return self.value(rest, now) if step.get("on_fail") == "skip" else 0.0

    def over(self, now: Now) -> bool:
        told = self.instance
        return now.t > told.budget_s or now.g + told.hotel_w * now.t > told.budget_j

    def start(self, step: Any, rest: Sequence[Any], now: Now) -> float:
        name = step["target"]
        if now.at != "start" or not self.instance.goals[name].place or name in now.tracked:
            return self.failed(step, rest, now)
        seconds, joules = self.instance.track_start
        now = now._replace(t=now.t + seconds, g=now.g + joules)
        if self.over(now):
            return -self.instance.penalty
        return self.value(rest, now._replace(tracked=now.tracked | {name}))

    def stop(self, step: Any, rest: Sequence[Any], now: Now) -> float:
        return self.value(rest, now._replace(tracked=now.tracked - {step["target"]}))

    def observe(self, step: Any, rest: Sequence[Any], now: Now) -> float:
        name = step["target"]
        goal = self.instance.goals[name]
        opens, closes = goal.window_s
        untracked = goal.place and name not in now.tracked
        if now.at != name or name in now.done or now.t > closes or untracked:
            return self.failed(step, rest, now)
        now = now._replace(t=max(now.t, opens) + goal.time_s[0], g=now.g + goal.energy_j[0])
        if self.over(now):
            return -self.instance.penalty
        now = now._replace(tracked=now.tracked - {name}, done=now.done | {name})
        return goal.p_success * goal.utility + self.value(rest, now)

    def drive(self, step: Any, rest: Sequence[Any], now: Now) -> float:
        visit = step["op"] == "visit"
        name = step["target"] if visit else step["to"]
        asks = visit or step.get("require_tracked")
        leg = self.instance.legs.get((now.at, name))
        if asks and self.instance.goals[name].place and name not in now.tracked:
            return self.failed(step, rest, now)
        if now.at != name and leg is None:
            return self.failed(step, rest, now)
        value = 0.0
        for chance, there in [(1.0, now)] if leg is None or now.at == name else self.arrivals(name, now):
            if now.at != name and self.over(there):
                value -= chance * self.instance.penalty
            else:
                value += chance * (self.observe if visit else self.pass_on)(step, rest, there)
        return value

    def pass_on(self, _step: Any, rest: Sequence[Any], now: Now) -> float:
        return self.value(rest, now)

    def arrivals(self, name: str, now: Now) -> list[tuple[float, Now]]:
        """Return each set of tracks that may be left after a drive, with its chance."""
        leg = self.instance.legs[now.at, name]
        there = now._replace(
            t=now.t + leg.time_s[0] + self.instance.track_overhead_s * len(now.tracked),
            g=now.g + leg.energy_j[0],
            at=name,
            tracked=frozenset(),
        )
        ends = [(1.0, there)]
        for track in sorted(now.tracked):
            lose = leg.p_lose.get(track, 0.0)
            kept = [(p * (1.0 - lose), end._replace(tracked=end.tracked | {track})) for p, end in ends]
            ends = kept + [(p * lose, end) for p, end in ends if lose]
        return ends
