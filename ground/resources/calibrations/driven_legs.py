"""Legs out of recorded runs, and the calibration of the path network they bear out.

A leg is one `navigate` of a run: where it began and ended by dead reckoning, how long it took and what it
used, and which targets were tracked when it began and no longer when it ended. The path network knows a leg
as the straight path between its ends, so metres inside, outside and hidden are counted on that way, with the
planner's own measure, on the planner's map.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.day.prepare import calibration_of, network_heights, rover_parameters
from ground.errors import ArchiveError, InvalidInputError
from ground.gdr.packed import read_kept
from ground.resources.calibrations.made_activities import MadeActivity, fitted

if TYPE_CHECKING:
    from planner.path_network import Calibration
    from rover_iface.profile import RoverProfile
    from rover_iface.terrain import Terrain

FEWEST_LEGS = 10


@dataclass(frozen=True, slots=True)
class WatchedTrack:
    """A target that was tracked when a leg began: its place and the place it was first seen from, metres
    east, north and up.

    `lost`: it was not tracked when the leg ended, nor, unless it was where the leg led, at the end of a later
    one.
    """

    target: str
    point: tuple[float, float, float]
    first_seen: tuple[float, float]
    lost: bool


@dataclass(frozen=True, slots=True)
class DrivenLeg:
    """One drive of a run; poses (east, north, heading) are dead reckoning's, energy is without hotel load.

    `to` is the target that it was to come to, empty for a drive to a place.
    """

    run: str
    task: str
    begin: tuple[float, float, float]
    end: tuple[float, float, float]
    duration_s: float
    energy_j: float
    arrived: bool
    tracks: tuple[WatchedTrack, ...]
    to: str = ""

    @property
    def failed(self) -> bool:
        """Whether it set out and ended short, other than by the track that it followed: that has odds of its
        own.
        """
        lost = any(t.lost and t.target == self.to for t in self.tracks)
        return not self.arrived and self.duration_s > 0.0 and not lost

    @property
    def length_m(self) -> float:
        """Return the length of the straight path."""
        return math.hypot(self.end[0] - self.begin[0], self.end[1] - self.begin[1])

    @property
    def turn_rad(self) -> float:
        """Return the turns in place that the straight path asks for: towards the end, and to the last one."""
        way = math.atan2(self.end[1] - self.begin[1], self.end[0] - self.begin[0])
        return abs(_wrap(way - self.begin[2])) + abs(_wrap(self.end[2] - way))


def legs_of_run(folder: Path) -> list[DrivenLeg]:
    """Return the legs of a folder `run/1`, from its journal and its last odometry and tracking history.

    Raises
    ------
    ArchiveError
        If the folder is not a run, or its rover recorded no odometry and no tracking history.
    """
    try:
        journal = [json.loads(line) for line in read_kept(folder / "journal.jsonl").decode().splitlines()]
        odometry, history = (_last_table(folder, kind) for kind in ("odometry", "tracking"))
    except (OSError, ValueError) as err:
        raise ArchiveError(f"{folder.name}: no legs can be read: {err}") from err
    if not odometry:
        raise ArchiveError(f"{folder.name} holds no odometry; only a rover on terrain records it")
    try:
        history = sorted([*history, *_let_go(journal)], key=lambda row: float(row["t_s"]))
        drives = list(_drives(journal))
        ends_s = [drive[3] for drive in drives]
        return [
            _leg(folder.name, drive, odometry, history, ends_s[k + 1 :]) for k, drive in enumerate(drives)
        ]
    except (AttributeError, KeyError, TypeError, IndexError, ValueError) as err:
        raise ArchiveError(f"{folder.name}: a record is malformed: {err!r}") from err


def _last_table(folder: Path, kind: str) -> list[dict[str, Any]]:
    """Return the rows of the newest table of a kind; each holds the whole run up to its time."""
    found = sorted((folder / "products").glob(f"*-{kind}.json"))
    rows: list[dict[str, Any]] = json.loads(found[-1].read_text("utf-8")) if found else []
    return rows


def _let_go(journal: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield when a target is followed no longer, as after its placement: the tracker's own history, which has
    its answers, does not say so.
    """
    for record in journal:
        for event in record.get("events", ()):
            for key, state in {**event.get("values", {}), **event.get("updates", {})}.items():
                name = str(key).removeprefix("trackerstate ")
                if name != key and state == "idle":
                    yield {"t_s": event["t"] / 1000.0, "target": name, "state": state}


def _drives(journal: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, float, float, Mapping[str, Any]]]:
    """Return task, target, begin and end (s) and the result of every drive, also of one that was under way
    when a budget of the plan ended: it would not have been cut short had it arrived as it was to.
    """
    now, sent, found = 0.0, {}, []
    for record in journal:
        now = record.get("t", 1000.0 * now) / 1000.0
        if record["k"] == "send" and record["action"] == "navigate":
            sent[tuple(record["id"])] = now, str(record["parameters"].get("target", ""))
        elif record["k"] == "step":
            for event in record["events"]:
                begun = sent.pop(tuple(event.get("command", ())), None) if event["e"] == "result" else None
                if begun is not None:
                    begin_s, to = begun
                    found.append((str(event["command"][1]), to, begin_s, event["t"] / 1000.0, event))
        elif record["k"] == "end" and record["outcome"] == "FAILED":
            cut = {"success": False, "values": {}}
            found += [(str(task), to, begin_s, now, cut) for (_, task, _), (begin_s, to) in sent.items()]
    return found


def _leg(
    run: str,
    drive: tuple[str, str, float, float, Mapping[str, Any]],
    odometry: Sequence[Mapping[str, Any]],
    history: Sequence[Mapping[str, Any]],
    later_s: Sequence[float],
) -> DrivenLeg:
    """Return a drive; `later_s` are the times at which the later ones of the run ended."""
    task, to, begin_s, end_s, result = drive
    tracks = []
    for target in sorted({row["target"] for row in history}):
        rows = [row for row in history if row["target"] == target and row["t_s"] <= end_s]
        before = [row for row in rows if row["t_s"] <= begin_s]
        if not before or before[-1]["state"] != "tracked":
            continue
        x, y, z = before[-1]["position_m"]
        begun = next(row for row in before if row["state"] == "tracked")
        seen = _pose_at(odometry, begun["t_s"])
        lost = rows[-1]["state"] != "tracked"
        if lost and target != to:  # the planner knows no track that comes back
            lost = not any(_tracked(history, target, t_s) for t_s in later_s)
        tracks.append(WatchedTrack(target, (x, y, z), (seen[0], seen[1]), lost))
    return DrivenLeg(
        run,
        task,
        _pose_at(odometry, begin_s),
        _pose_at(odometry, end_s),
        end_s - begin_s,
        float(result["values"].get("energy_j", 0.0)),
        bool(result["success"]),
        tuple(tracks),
        to,
    )


def _tracked(history: Sequence[Mapping[str, Any]], target: str, t_s: float) -> bool:
    """Return whether the last answer about a target by a time was that it is tracked."""
    states = [row["state"] for row in history if row["target"] == target and row["t_s"] <= t_s]
    return bool(states) and states[-1] == "tracked"


def _pose_at(odometry: Sequence[Mapping[str, Any]], t_s: float) -> tuple[float, float, float]:
    """Return the believed pose at a time: the last one recorded by then."""
    row = odometry[0]
    for later in odometry:
        if later["t_s"] > t_s + 1e-6:
            break
        row = later
    x, y, _, heading = row["believed"]
    return float(x), float(y), float(heading)


def calibrate(
    legs: Sequence[DrivenLeg],
    profile: RoverProfile,
    terrains: Mapping[str, Terrain] | Terrain | None = None,
    *,
    name: str,
    source: str,
    prior: Calibration | None = None,
    made: Sequence[MadeActivity] = (),
    report: Callable[[float], None] = lambda _share: None,
) -> Calibration:
    """Return the calibration that legs bear out; a run is a day.

    Parameters
    ----------
    terrains
        The map that the planner had, one for all or one for each run by its name; without it nothing counts
        as hidden.
    prior
        What the legs do not tell stays as here; the rover profile's numbers when absent.
    made
        What else the runs did.
    report
        Called before each leg with the share of them that is done.

    Raises
    ------
    InvalidInputError
        If there are fewer than ten legs of at least 0.5 m.
    """
    import numpy as np

    from planner.path_network import fit_calibration

    driven = [leg for leg in legs if leg.length_m >= 0.5 and leg.duration_s > 0]
    if len(driven) < FEWEST_LEGS:
        raise InvalidInputError(
            f"{len(driven)} legs of at least 0.5 m were driven in the runs; {FEWEST_LEGS} are needed"
        )
    prior = prior or calibration_of(profile)
    exposures, lost, own = [], [], []
    for index, leg in enumerate(driven):
        report(index / len(driven))
        terrain = terrains.get(leg.run) if isinstance(terrains, Mapping) else terrains
        for track, metres in zip(leg.tracks, exposure_m(leg, profile, terrain, prior), strict=True):
            if sum(metres) > 0:
                exposures.append(metres)
                lost.append(track.lost)
                own.append(track.target == leg.to)
    rover = rover_parameters(profile)
    watched = np.array([len(leg.tracks) for leg in driven], dtype=float)
    arrived = np.array([leg.arrived for leg in driven])
    if arrived.sum() < FEWEST_LEGS:
        raise InvalidInputError(f"{arrived.sum()} legs arrived; {FEWEST_LEGS} are needed for times")
    return fit_calibration(
        name=name,
        source=source,
        prior=prior,
        length_m=np.array([leg.length_m for leg in driven])[arrived],
        turn_rad=np.array([leg.turn_rad for leg in driven])[arrived],
        duration_s=np.array([leg.duration_s for leg in driven])[arrived],
        energy_j=np.array([max(leg.energy_j, 1.0) for leg in driven])[arrived],
        speed_m_s=rover.speed_m_s,
        turn_rate_rad_s=rover.turn_rate_rad_s,
        drive_power_w=rover.drive_power_w,
        exposure_m=exposures or None,
        lost=lost or None,
        own=own if any(own) else None,
        failures=sum(leg.failed for leg in legs),
        tried_m=[leg.length_m for leg in legs if leg.duration_s > 0.0],
        day=[leg.run for leg in driven if leg.arrived],
        tracked=watched[arrived],
        track_overhead_s=rover.track_overhead_s,
        activities=fitted(made, profile),
    )


def exposure_m(
    leg: DrivenLeg, profile: RoverProfile, terrain: Terrain | None, calibration: Calibration
) -> list[tuple[float, float, float]]:
    """Return metres inside the tracking region, outside it and hidden for each track of a leg."""
    import numpy as np

    from planner.path_network import NetworkRequest, Pose, Target
    from planner.path_network.tracking import loss_exposure

    if not leg.tracks:
        return []
    ends = [leg.begin[:2], leg.end[:2]]
    heights = None
    if terrain is not None:
        heights = network_heights(terrain, [*ends, *(t.point[:2] for t in leg.tracks)])
    request = NetworkRequest(
        start=Pose(*leg.begin),
        targets=tuple(
            Target(t.target, t.point[0], t.point[1], t.point[2], True, t.first_seen) for t in leg.tracks
        ),
        observation_points=(),
        terrain=heights,
        rover=rover_parameters(profile),
        calibration=calibration,
    )
    found = loss_exposure(request, np.array([ends[0]]), np.array([ends[1]]), heights)[0]
    return [(float(row[0]), float(row[1]), float(row[2])) for row in found]


def _wrap(angle: float) -> float:
    return (angle + math.pi) % (2 * math.pi) - math.pi
