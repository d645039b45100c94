"""A mission's day as plain data, as it travels to the process that works on it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.day.convert import (
    DayDriveRule,
    DayKeepOut,
    DayLimits,
    DayRequest,
    DayTarget,
    PreparedDay,
    Report,
    StandPose,
    prepare_day,
)
from ground.errors import JobFailedError

if TYPE_CHECKING:
    from planner.path_network import PathNetwork

INSTRUMENTS = {"microscopic_imager": "mi", "science_camera": "scicam"}
"""Names of instruments in the repository, and in rover profiles."""


def instrument_name(in_profile: str) -> str:
    """Return the repository's name of an instrument of a rover profile."""
    return next((name for name, short in INSTRUMENTS.items() if short == in_profile), in_profile)


def _pose(document: dict[str, Any] | None) -> StandPose | None:
    return None if document is None else StandPose(**document)


def _drive_rule(document: dict[str, Any]) -> DayDriveRule:
    via = document["via_m"]
    return DayDriveRule(
        document["from_target_id"],
        document["to_target_id"],
        None if via is None else tuple((e, n) for e, n in via),
    )


def prepare(payload: dict[str, Any], report: Report) -> PreparedDay:
    """Return the day of a payload made ready to plan.

    Raises
    ------
    JobFailedError
        If start, keep-outs or requests are impossible on this terrain.
    """
    from ground.gdr.terrain_folders import load_cached
    from planner.errors import PlannerError
    from planner.path_network import calibration_from_json
    from rover_iface.errors import RoverError
    from rover_iface.profile import load_profile

    limits = payload["limits"]
    document = payload.get("calibration")  # jobs of before missions had one lack it
    try:
        calibration = None if document is None else calibration_from_json(json.dumps(document))
        return prepare_day(
            load_cached(Path(payload["terrain_dir"])),
            load_profile(payload["rover_profile"]),
            DayLimits(
                name=limits["name"],
                start=StandPose(**limits["start"]),
                time_s=limits["time_s"],
                energy_j=limits["energy_j"],
                overrun_penalty=limits["overrun_penalty"],
                data_mbit=limits["data_mbit"],
                max_overrun_probability=limits.get("max_overrun_probability"),
                refs=limits["refs"],
            ),
            [
                DayTarget(t["id"], t["name"], tuple(t["point_site"]), tuple(t["normal_site"]))
                for t in payload["targets"]
            ],
            [
                DayRequest(
                    id=r["id"],
                    target_id=r["target_id"],
                    instrument=INSTRUMENTS.get(r["instrument"], r["instrument"]),
                    value=r["value"],
                    tracked=r["tracked"],
                    window_s=None if r["window_s"] is None else (r["window_s"][0], r["window_s"][1]),
                    after=tuple(r["after"]),
                    must_do=r["must_do"],
                    dwell_s=r["dwell_s"],
                    observation_point=_pose(r["observation_pose"]),
                )
                for r in payload["requests"]
            ],
            [DayKeepOut(k["id"], tuple((e, n) for e, n in k["polygon_m"])) for k in payload["keep_outs"]],
            drive_rules=[_drive_rule(rule) for rule in payload.get("drive_rules", ())],
            calibration=calibration,
            report=report,
        )
    except (PlannerError, RoverError) as err:
        raise JobFailedError(str(err)) from err


def network_geometry(day: PreparedDay) -> dict[str, Any]:
    """Return a path network as the repository keeps it."""
    network: PathNetwork = day.network
    asked: dict[str, list[str]] = {}
    for target in day.problem["targets"]:
        asked[target["id"]] = [o["id"] for o in target["observations"]]
    chosen = {point: target for target, point in network.best_points().items()}
    used = {"start", *chosen}
    return {
        "nodes": [
            {
                "id": name,
                "pose": {"east_m": p.east_m, "north_m": p.north_m, "heading_rad": p.heading_rad},
                "target_id": chosen.get(name),
                "request_ids": asked.get(chosen.get(name, ""), []),
            }
            for name, p in network.places.items()
            if name in used
        ],
        "segments": [
            {
                "id": f"{route.origin}>{route.destination}",
                "start": route.origin,
                "end": route.destination,
                "points_m": [[round(x, 3), round(y, 3)] for x, y in route.points],
                "length_m": round(route.length_m, 3),
                "time_mean_s": round(route.duration_mean_s, 2),
                "time_sd_s": round(route.duration_sd_s, 2),
                "energy_mean_j": round(route.energy_mean_j, 1),
                "energy_sd_j": round(route.energy_sd_j, 1),
                "p_lose": {t: round(p, 5) for t, p in route.p_lose.items()},
            }
            for route in network.routes
            if route.origin in used and route.destination in used
        ],
        "regions": [
            {
                "target_id": region.target,
                "polygon_m": [[round(x, 3), round(y, 3)] for x, y in region.polygon],
            }
            for region in network.regions
        ],
        "hazards_m": [[[round(x, 3), round(y, 3)] for x, y in ring] for ring in network.hazards],
        "margins_m": [[[round(x, 3), round(y, 3)] for x, y in ring] for ring in network.margins],
        "unreachable": {refusal.request_id: refusal.reason for refusal in day.refused},
        "notes": list(network.notes),
    }


def observation_points(day: PreparedDay) -> dict[str, dict[str, float]]:
    """Return the pose chosen for each target."""
    return {
        target: {"east_m": p.east_m, "north_m": p.north_m, "heading_rad": p.heading_rad}
        for target, p in day.observation_points.items()
    }
