"""The ground and the rover that a day is for, as jobs are told of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from ground.day.prepare import PreparedDay, Report, prepare_day
from ground.errors import InvalidInputError, JobFailedError
from ground.gdr.places import fetched
from ground.gdr.terrain_folders import load_cached
from mission import Day
from mission.codec import Document
from mission.values import value


@value
class Worksite:
    """Where a mission's day takes place, and with which rover.

    Parameters
    ----------
    terrain_dir
        Folder of the terrain (`terrain/1`), or its address (`ground.gdr.store`).
    rover_profile
        Name of a rover profile, or the path of one.
    calibration
        What was learned from runs (`calibration/1`); None leaves the profile's own leg model.
    """

    mission_id: str
    terrain_dir: str
    rover_profile: str
    calibration: Document | None = None

    def prepare(self, day: Day, report: Report) -> PreparedDay:
        """Return a day made ready to plan here.

        Raises
        ------
        JobFailedError
            If start, keep-outs or requests are impossible on this terrain or for this rover.
        """
        from planner.errors import PlannerError
        from planner.path_network import CALIBRATIONS
        from rover_iface.errors import RoverError
        from rover_iface.profile import load_profile

        try:
            learned = self.calibration
            return prepare_day(
                load_cached(fetched(self.terrain_dir)),
                load_profile(self.rover_profile),
                day,
                calibration=None if learned is None else CALIBRATIONS.from_document(learned),
                report=report,
            )
        except (PlannerError, RoverError) as err:
            raise JobFailedError(str(err)) from err
        except InvalidInputError as err:
            raise JobFailedError(err.message) from err


def from_version_0(payload: Mapping[str, object]) -> dict[str, object]:
    """Return the members `site` and `day` of a job that version 0.1 left in a database without a format."""
    limits = cast("Mapping[str, object]", payload["limits"])
    requests = cast("Sequence[Mapping[str, Any]]", payload["requests"])
    return {
        "site": {
            "mission_id": payload["mission_id"],
            "terrain_dir": payload["terrain_dir"],
            "rover_profile": payload["rover_profile"],
            "calibration": payload.get("calibration"),  # missions had none at first
        },
        "day": {
            "name": limits["name"],
            "start": limits["start"],
            "limits": {
                "time_s": limits["time_s"],
                "energy_j": limits["energy_j"],
                "overrun_penalty": limits["overrun_penalty"],
                "data_mbit": limits["data_mbit"],
                "max_overrun_probability": limits.get("max_overrun_probability"),
            },
            "targets": payload["targets"],
            "requests": [_request_of_version_0(request) for request in requests],
            "keep_outs": payload["keep_outs"],
            "drive_rules": payload.get("drive_rules", []),
            "refs": limits["refs"],
        },
    }


def _request_of_version_0(request: Mapping[str, Any]) -> dict[str, object]:
    constraints: list[dict[str, object]] = [{"kind": "after", "request_id": i} for i in request["after"]]
    for member, kind in (("tracked", "tracked"), ("must_do", "must_do")):
        if request[member]:
            constraints.append({"kind": kind})
    if request["window_s"] is not None:
        opens_s, closes_s = request["window_s"]
        constraints.append({"kind": "window", "opens_s": opens_s, "closes_s": closes_s})
    return {
        "id": request["id"],
        "target_id": request["target_id"],
        "instrument": request["instrument"],
        "value": request["value"],
        "constraints": constraints,
        "dwell_s": request["dwell_s"],
        "observation_point": request["observation_pose"],
    }
