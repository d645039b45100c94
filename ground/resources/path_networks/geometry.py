"""A path network as the repository keeps it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

from ground.day.prepare import PreparedDay


def network_geometry(day: PreparedDay) -> Mapping[str, object]:
    """Return a path network as the repository keeps it."""
    network = day.network
    asked = {str(t.id): [str(o.id) for o in t.observations] for t in day.problem.targets}
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
                "p_fail": round(route.p_fail, 5),
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
    """Return the pose chosen for each target, m and rad."""
    return {target: asdict(pose) for target, pose in day.observation_points.items()}
