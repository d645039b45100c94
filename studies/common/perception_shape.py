"""Registration of stereo surfaces from bad starts: the shipped engine, the published one, and plain ICP."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from rover_iface.frames import Transform
from rover_iface.vision.handoff import Side
from rover_iface.vision.shape import register
from rover_iface.vision.shape_draped import register_views
from rover_iface.vision.sift_motion import small_rotation
from rover_iface.vision.surface import ShapeOptions, Surface
from rover_iface.vision.tracker import StereoView
from studies.common.perception_worlds import Shot, approach
from studies.common.tracking_worlds import Array

PAIRS = {
    "navcam 2.0 m to navcam 1.5 m": (-4, -1),
    "navcam 3.2 m to hazcam": (-8, None),
    "navcam 1.5 m to hazcam": (-1, None),
}


def true_view(left: Shot, right: Shot) -> StereoView:
    """Return a pair with the cameras as they really stood."""
    return StereoView(left.unit, right.unit, left.true, right.true)


def wrong_start(point: Array, rng: np.random.Generator, shift_m: float, turn_rad: float) -> Transform:
    """Return a motion about a point, in a random direction."""
    axis, shift = rng.normal(size=3), rng.normal(size=3) * (1.0, 1.0, 0.5)
    turn = small_rotation(turn_rad * axis / np.linalg.norm(axis))
    return Transform(turn, point - turn @ point + shift_m * shift / np.linalg.norm(shift))


def plain_icp(kind: str) -> Callable[[Surface, Surface, Transform, Array], Transform]:
    """Return small-gicp's own `align` from the start as it is: what a user of a library runs."""

    def run(model: Surface, scene: Surface, start: Transform, point: Array) -> Transform:
        import small_gicp

        source, target = model.near(point, 0.75).points, scene.near(point, 1.5).points
        pose = np.eye(4)
        pose[:3, :3] = start.rotation
        pose[:3, 3] = start.translation + start.rotation @ point - point
        result = small_gicp.align(
            target - point,
            source - point,
            pose,
            registration_type=kind,
            downsampling_resolution=0.02,
            max_correspondence_distance=0.3,
            max_iterations=60,
            num_threads=1,
        )
        u, _, vt = np.linalg.svd(np.asarray(result.T_target_source)[:3, :3])
        turn = u @ vt
        return Transform(turn, np.asarray(result.T_target_source)[:3, 3] - turn @ point + point)

    return run


def registration_study(
    worlds: list[int],
    folder: Path,
    say: Callable[[str], None],
    keep: Callable[[dict[str, Any]], None],
) -> dict[str, Any]:
    """Return errors at the target, CPU time and flags, from starts half a rock and 10 degrees off.

    What a view is asked for once, its surface and its features, is made before and timed by itself. `keep`
    gets what is known after each world.
    """
    found: dict[str, Any] = {}
    peers = {"point-to-point ICP": "ICP", "point-to-plane ICP": "PLANE_ICP", "GICP alone": "GICP"}
    options = {"surfaces alone": ShapeOptions(), "published": ShapeOptions(engine="nelder-mead")}
    rows: dict[str, dict[str, list[tuple[float, float, bool]]]] = {
        engine: {pair: [] for pair in PAIRS} for engine in ("shipped", *options, *peers)
    }
    made: list[tuple[float, float]] = []
    for seed in worlds:
        sequence = approach(seed, folder)
        halts = sequence.halts
        sides: dict[int | None, Side] = {
            n: Side(true_view(halts[n].left, halts[n].right), 0.8) for n in (-8, -4, -1)
        }
        sides[None] = Side(true_view(*sequence.hazcam), 0.3)
        made += [_make(side) for side in sides.values()]
        rng = np.random.default_rng([seed, 0x5A9E])
        if seed == worlds[0]:
            _compile(sides, sequence.targets[0][1], list(options.values()))
        for pair, (a, b) in PAIRS.items():
            model, scene = sides[a].surface, sides[b].surface
            assert model is not None
            assert scene is not None
            for _, point in sequence.targets[::3]:
                start = wrong_start(point, rng, 0.5 * sequence.rock.diameter, np.radians(10.0))
                for engine, by in rows.items():
                    began = time.process_time()
                    if engine == "shipped":
                        lain = register_views(sides[a], sides[b], start, point)
                        motion, accepted = lain.scene_from_model, lain.accepted
                    elif engine in options:
                        lain = register(model, scene, start, point, options[engine])
                        motion, accepted = lain.scene_from_model, lain.accepted
                    else:
                        motion, accepted = plain_icp(peers[engine])(model, scene, start, point), True
                    error = float(np.linalg.norm(motion.apply(point) - point))
                    by[pair].append((error, time.process_time() - began, accepted))
        say(f"  registration, world {seed}")
        found = {
            "worlds": worlds[: worlds.index(seed) + 1],
            "surface_cpu_s": float(np.median([m[0] for m in made])),
            "features_cpu_s": float(np.median([m[1] for m in made])),
            "engines": {engine: {pair: _summary(r) for pair, r in by.items()} for engine, by in rows.items()},
        }
        keep(found)
    return found


def _compile(sides: dict[int | None, Side], point: Array, options: list[ShapeOptions]) -> None:
    """Run every engine once, so that no time has the compilation of its kernels in it."""
    for a, b in PAIRS.values():
        model, scene = sides[a].surface, sides[b].surface
        assert model is not None
        assert scene is not None
        register_views(sides[a], sides[b], Transform.identity(), point)
        for engine in options:
            register(model, scene, Transform.identity(), point, engine)


def _make(side: Side) -> tuple[float, float]:
    """Make what a view is asked for once; return CPU s of its surface and of its features."""
    began = time.process_time()
    _ = side.surface
    then = time.process_time()
    _ = side.features, side.picture_features
    return then - began, time.process_time() - then


def _summary(rows: list[tuple[float, float, bool]]) -> dict[str, float | None]:
    errors = 100.0 * np.array([r[0] for r in rows])
    taken = np.array([r[2] for r in rows])
    kept = errors[taken]
    return {
        "trials": len(rows),
        "within_1_percent": 100.0 * float(np.mean(errors <= 1.0)),
        "accepted_percent": 100.0 * float(taken.mean()),
        "accepted_median_cm": float(np.median(kept)) if len(kept) else None,
        "accepted_p95_cm": float(np.percentile(kept, 95)) if len(kept) else None,
        "accepted_max_cm": float(kept.max()) if len(kept) else None,
        "cpu_s": float(np.median([r[1] for r in rows])),
        "cpu_max_s": float(max(r[1] for r in rows)),
    }
