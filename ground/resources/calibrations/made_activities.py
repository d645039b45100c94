"""Starts of tracks, placements and images out of recorded runs: whether each succeeded, and what it took."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.errors import ArchiveError
from ground.gdr.packed import read_kept

if TYPE_CHECKING:
    from planner.path_network import ActivityFit
    from rover_iface.profile import RoverProfile


@dataclass(frozen=True, slots=True)
class MadeActivity:
    """One activity of a run that came to a result; `kind` is its instrument, or `trackstart`. A run is a day;
    "" where it is not known.
    """

    kind: str
    success: bool
    duration_s: float
    energy_j: float
    run: str = ""


def activities_of_run(folder: Path, profile: RoverProfile) -> list[MadeActivity]:
    """Return the activities of a folder `run/1` but its drives, in time.

    Raises
    ------
    ArchiveError
        If the folder is not a run, or a record of it is malformed.
    """
    try:
        lines = read_kept(folder / "journal.jsonl").decode().splitlines()
        return list(_made(folder.name, [json.loads(line) for line in lines], profile))
    except (OSError, ValueError) as err:
        raise ArchiveError(f"{folder.name}: no activities can be read: {err}") from err
    except (AttributeError, KeyError, TypeError, IndexError) as err:
        raise ArchiveError(f"{folder.name}: a record is malformed: {err!r}") from err


def _made(run: str, journal: Sequence[Mapping[str, Any]], profile: RoverProfile) -> Iterator[MadeActivity]:
    from planner.path_network import TRACK_START

    now_s, sent = 0.0, {}
    for record in journal:
        now_s = record.get("t", 1000.0 * now_s) / 1000.0
        if record["k"] == "send":
            named = str(record["parameters"].get("instrument", ""))
            kind = TRACK_START if record["action"] == TRACK_START else named
            if kind == TRACK_START or kind in profile.instruments:
                sent[tuple(record["id"])] = kind, now_s
            continue
        for event in record.get("events", ()):
            begun = sent.pop(tuple(event.get("command", ())), None) if event["e"] == "result" else None
            if begun is not None:
                energy_j = max(0.0, float(event.get("values", {}).get("energy_j", 0.0)))
                took_s = event["t"] / 1000.0 - begun[1]
                yield MadeActivity(begun[0], bool(event["success"]), took_s, energy_j, run)


def fitted(made: Sequence[MadeActivity], profile: RoverProfile) -> tuple[ActivityFit, ...]:
    """Return what is believed of each kind of activity that runs made, by name; the others stay the
    profile's.

    Successes of an instrument on one day may go together. Starts of tracks are not asked for it: plans turn
    on what those come to, so their worth would change with it.
    """
    from planner.path_network import TRACK_START, ActivityFit, fit_activity

    tracking = profile.activity("trackstart")
    beliefs = {TRACK_START: ActivityFit(TRACK_START, 1.0, tracking.fixed_s, 0.0, tracking.fixed_j, 0.0)} | {
        name: ActivityFit(name, i.p_success, i.time_s.mean, i.time_s.sd, i.energy_j.mean, i.energy_j.sd)
        for name, i in profile.instruments.items()
    }
    found = []
    for kind, belief in sorted(beliefs.items()):
        some = [one for one in made if one.kind == kind]
        days = [one.run for one in some if one.run] if kind != TRACK_START else []
        if some:
            found.append(
                fit_activity(
                    belief,
                    [one.success for one in some],
                    [one.duration_s for one in some],
                    [one.energy_j for one in some],
                    days if len(days) == len(some) else (),
                )
            )
    return tuple(found)
