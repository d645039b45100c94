"""Placements over many rocks: unsafe accepts, false refusals, errors; and what stereo does at arm's length.

`python -m studies.placement --rocks 1000 --rendered 120 --out studies/results/placement.json`

Each rock is another scene of `placement_rocks` with another designated point, uniform over the visible face,
and an error of 5 mm as of a hand-off; rocks that a neighbour hides are left out. The hazcams and the mast's
pair look at each (`placement_stereo`): the mast stands at other angles than those that are read and is out
of calibration, and its cloud is laid on the hazcams' before it is used. Rocks of `--rendered` are seen by
dense stereo on rendered pairs, those of `--rocks` by the cheap model of stereo; the two run through the same
check, so that the first vouch for the second. The mast's narrow pair looks at a place before the tool is put
there; what it sees is rendered for both.

The rover moves as the `full` one does: to where the arm reaches, and to see the designated point from another
side. Pictures, hand-off, spot and drive err anew there.

The truth is cast on the triangles, along the tool's true axis and with the arm's error, against what the
instrument bears (`TrueLimits`). An accept is unsafe if anything is wrong there. A refusal, or a move that
brought nothing, is false if within the search radius the left camera sees, from the first stand or the last,
a place of the rock that is truly safe and that the arm reaches. A placement is on the designated point if the
tool touches within 5 mm of what the scientist picked, the hand-off's error in that; it can be wanted where
that point is truly safe and within reach from the first stand.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.behaviour.base_moves import MOVES
from rover_iface.behaviour.close_look import meant_on, registered
from rover_iface.errors import CameraError, RenderError
from rover_iface.frames import Pose
from rover_iface.placement import PlacementVerdict, SafetyLimits, plan_placement, segment
from rover_iface.placement.arm import Arm, ArmRefusal, Posture
from rover_iface.placement.base_adjustment import FARTHEST_MOVE_M, MOST_TURN_RAD, mast_eye
from rover_iface.placement.cloud import SurfaceCloud
from rover_iface.placement.cloud_alignment import Alignment, align
from rover_iface.placement.narrow_looks import NarrowLook
from rover_iface.placement.segmentation import Segmentation, SegmentationOptions
from rover_iface.profile import load_profile
from studies.common.placement_rocks import HERE, RockScene, rock_scene
from studies.common.placement_stereo import RockView, narrow_view
from studies.common.true_surface import TrueLimits

Array = npt.NDArray[np.float64]

HANDOFF_M = 0.005
ON_POINT_M = 0.005

SPOT_M = 0.0015
"""One deviation, each way across the line of sight, of the spot that the designated pixel of the near navcams
shows: eight tracks that the first narrow picture corrected were 2.0 mm off, rms over both
(`vision.narrow.recall`). After a move it is asked again.
"""

DRIVE_M, DRIVE_RAD = 0.02, 0.03
"""One deviation, each way, of where such a move ends and of its heading: 5 % of the longest."""

STAND_SEED = 1 << 43
"""Added to a rock's seed, times the number of the stand, for the noise of its pictures and hand-off."""

EVALUATION = 48_573
"""Seeds from here on were not looked at; limits were set on 5,000 to 25,999 and 29,000 to 29,742, those of
the narrow look on 16,000 to 16,112. Reported were 41,000 to 45,257, 48,000 to 48,425
and 48,566 to 48,572; what failed there was looked at but for 48,000 to 48,157, and at 46,000 to 46,024.
Nobody looked at 48,426 to 48,565 either."""

MAST_SEED = 1 << 40
"""Added to a rock's seed for the noise of the mast's pictures."""

NARROW_SEED = 1 << 41
"""Added to a rock's seed for the noise of the narrow pair's pictures."""


def designated(rock: RockScene) -> tuple[Array, Array]:
    """Return the point that a scientist picks on the visible face, and where the hand-off puts it."""
    one, _, far, body, _ = rock.seen
    rng = np.random.default_rng([rock.seed, 0xDE5])
    places = np.argwhere(body == rock.target_index)
    line, sample = places[rng.integers(len(places))]
    eye, ray = one.back_project((float(sample), float(line)))
    picked = np.asarray(eye + far[line, sample] * ray)
    return picked, picked + rng.normal(0.0, HANDOFF_M / math.sqrt(3.0), 3)


def spot(
    rock: RockScene, navcam: RockView, picked: Array, at: Array, laid: Alignment | None, off_m: Array
) -> Array:
    """Return where the rover has the point that was picked (3,), handed off to `at` (3,), by its pixel in the
    near navcams, `off_m` (2,) beside the true one across the line of sight: as the `full` rover does, from
    their cloud as it was `laid` on the hazcams'.

    `at` where the navcams do not see it or their cloud does not tell.
    """
    camera = navcam.left
    away = float(np.linalg.norm(picked - camera.C))
    free = float(rock.scene.ranges(camera.C, ((picked - camera.C) / away)[None])[0])
    if laid is None or navcam.told_from_true is None or free < away - ON_POINT_M:
        return at
    pixel = camera.project(picked) + off_m * camera.hs / away
    found = meant_on(laid, camera.transformed(navcam.told_from_true), pixel, at)
    return at if found is None else found


def is_safe(rock: RockScene, picked: Array, arm: Arm, true: TrueLimits) -> bool:
    """Return whether the point that was picked (3,) is truly safe, and within reach."""
    one, _, far, body, normal = rock.seen
    lines, samples = np.nonzero(body == rock.target_index)
    eyes, rays = one.back_project(np.column_stack((samples, lines)).astype(float))
    points = eyes + far[lines, samples][:, None] * rays
    around = np.linalg.norm(points - picked, axis=1) < arm.profile.tool_radius_m
    mean = normal[lines, samples][around].mean(axis=0)
    mean /= np.linalg.norm(mean)
    if rock.true_patch(picked, mean, arm.profile.tool_radius_m, true).wrong:
        return False
    return isinstance(arm.solve(picked, mean, max_tilt_rad=true.tilt_rad), Posture)


def safe_place(rock: RockScene, at: Array, arm: Arm, limits: SafetyLimits, true: TrueLimits) -> Array | None:
    """Return a point within reach that is truly safe, or None: of the visible face, every 12 mm."""
    one, _, far, body, normal = rock.seen
    lines, samples = np.nonzero(body == rock.target_index)
    eyes, rays = one.back_project(np.column_stack((samples, lines)).astype(float))
    points = eyes + far[lines, samples][:, None] * rays
    normals = normal[lines, samples]
    near = np.linalg.norm(points - at, axis=1) < limits.search_m
    cells = np.floor(points[near] / 0.012).astype(np.int64)
    for k in np.flatnonzero(near)[np.unique(cells, axis=0, return_index=True)[1]]:
        around = np.linalg.norm(points - points[k], axis=1) < arm.profile.tool_radius_m
        mean = normals[around].mean(axis=0)
        mean /= np.linalg.norm(mean)
        if -(mean @ rays[k]) < math.cos(limits.most_view_rad):
            continue
        if rock.true_patch(points[k], mean, arm.profile.tool_radius_m, true).wrong:
            continue
        answer = arm.solve(points[k], mean, max_tilt_rad=true.tilt_rad)
        if isinstance(answer, Posture):
            return np.asarray(points[k])
    return None


def rendered_clouds(rock: RockScene, at: Array) -> tuple[SurfaceCloud, SurfaceCloud | None]:
    """Return the clouds of dense stereo on rendered pairs: the hazcams', and the mast's, turned to a point
    (3,), laid on it; None where that is not believed.
    """
    cloud = rock.hazcam.rendered_cloud(rock.seed)
    laid = align(rock.navcam(at).rendered_cloud(rock.seed + MAST_SEED), cloud)
    return cloud, laid.cloud if laid is not None and laid.believed() else None


def narrow_look(rock: RockScene, cloud: SurfaceCloud, laid: Alignment | None) -> NarrowLook:
    """Return what asks the mast's narrow pair of a rock for a cloud, rendered, as the `full` rover does.

    `laid` is the wide pair's cloud registered to the hazcams' `cloud`, None if that was not believed.
    """
    motion = None if laid is None else laid.motion

    def look(at: Array) -> SurfaceCloud | None:
        try:
            view = narrow_view(rock.scene, rock.sun, rock.seed, at, motion)
            narrow = view.rendered_cloud(rock.seed + NARROW_SEED)
        except (CameraError, RenderError):
            return None
        return registered(narrow, motion, cloud if laid is None else laid.cloud) if len(narrow) else None

    return look


@dataclass(frozen=True, eq=False)
class Attempt:
    """What comes of a rock from one stand; frame of the rover there, m.

    Attributes
    ----------
    rock, picked, at, meant
        The scene; the point (3,) that was picked, where the hand-off has it, and where the navcams have it.
    cloud, found, laid, navcam
        What the hazcams show, its segmentation, and the navcams' cloud registered to it.
    """

    rock: RockScene
    picked: Array
    at: Array
    meant: Array
    cloud: SurfaceCloud
    found: Segmentation
    laid: Alignment | None
    navcam: RockView
    verdict: PlacementVerdict
    looks: int


def attempt(
    rock: RockScene,
    picked: Array,
    at: Array,
    off_m: Array,
    rendered: bool,
    views_left: int,
    seen_from: Sequence[Array],
) -> Attempt:
    """Return what comes of a point that was picked (3,), handed off to `at` (3,) and tracked with an error
    `off_m` (2,), m (`spot`); while there are `views_left` that may be a move to another stand than those
    with the mast's eye at `seen_from` (3,), from which it was seen before.
    """
    seed = rock.seed + len(seen_from) * STAND_SEED
    hazcam, navcam = rock.hazcam, rock.navcam(at)
    if rendered:
        cloud, mast = hazcam.rendered_cloud(seed), navcam.rendered_cloud(seed + MAST_SEED)
    else:
        cloud, mast = hazcam.cast_cloud(seed), navcam.cast_cloud(seed + MAST_SEED, (hazcam, seed))
    found = segment(cloud, SegmentationOptions() if rendered else SegmentationOptions(rounds=3, thinning=2))
    laid = align(mast, cloud)
    trusted = laid if laid is not None and laid.believed() else None
    meant = spot(rock, navcam, picked, at, trusted, off_m)
    looks: list[Array] = []
    ask = narrow_look(rock, cloud, trusted)

    def narrow(point: Array) -> SurfaceCloud | None:
        looks.append(point)
        return ask(point)

    verdict = plan_placement(
        cloud,
        meant,
        load_profile("k9"),
        segmentation=found,
        second=None if trusted is None else trusted.cloud,
        narrow=narrow,
        views_left=views_left,
        seen_from=seen_from,
    )
    return Attempt(rock, picked, at, meant, cloud, found, laid, navcam, verdict, len(looks))


def attempts(rock: RockScene, rendered: bool) -> list[Attempt]:
    """Return what comes of a rock from each stand in turn, moved as the `full` rover moves."""
    profile = load_profile("k9")
    picked, at = designated(rock)
    off_m = np.random.default_rng([rock.seed, 0x5107]).normal(0.0, SPOT_M, 2)
    stand, views_left, there = HERE, MOVES, picked
    tried = [attempt(rock, there, at, off_m, rendered, views_left, [])]
    eyes: list[Array] = []
    while views_left and (move := tried[-1].verdict.base_move) is not None:
        if move.distance_m <= FARTHEST_MOVE_M and abs(move.turn_rad) <= MOST_TURN_RAD:
            eyes.append(np.asarray(stand.site_from_rover.apply(mast_eye(profile)), dtype=np.float64))
            views_left -= 1
            rng = np.random.default_rng([rock.seed, 0x3072, len(eyes)])
            ahead, aside, turned = (float(v) for v in rng.standard_normal(3) * (DRIVE_M, DRIVE_M, DRIVE_RAD))
            pose = move.pose
            ended = replace(pose, x=pose.x + ahead, y=pose.y + aside, heading=pose.heading + turned)
            stand = Pose.from_transform(stand.site_from_rover * ended.site_from_rover)
            rock = rock_scene(rock.seed, stand)
            there = np.asarray(stand.site_from_rover.inverse().apply(picked), dtype=np.float64)
            at = np.asarray(there + rng.normal(0.0, HANDOFF_M / math.sqrt(3.0), 3))
            off_m = rng.normal(0.0, SPOT_M, 2)
        else:
            views_left = 0
        rover = stand.site_from_rover.inverse()
        seen_from = [np.asarray(rover.apply(eye), dtype=np.float64) for eye in eyes]
        tried.append(attempt(rock, there, at, off_m, rendered, views_left, seen_from))
    return tried


def trial(seed: int, rendered: bool) -> dict[str, Any]:
    """Return what came of one rock."""
    profile, limits, true = load_profile("k9"), SafetyLimits(), TrueLimits()
    arm = Arm(profile.arm)
    rock = rock_scene(seed)
    if not (rock.seen[3] == rock.target_index).any():
        # a neighbour hides it: there is nothing to pick
        return {"seed": seed, "diameter_m": rock.diameter_m, "decision": "unseen"}
    began = time.process_time()
    tried = attempts(rock, rendered)
    first, last = tried[0], tried[-1]
    verdict = last.verdict
    row: dict[str, Any] = {
        "seed": seed,
        "diameter_m": rock.diameter_m,
        "points": len(last.cloud),
        "decision": verdict.decision.value,
        "stands": len(tried),
        "moves_m": [one.verdict.base_move.distance_m for one in tried if one.verdict.base_move is not None],
        "first_findings": [[f.reason.value, f.value, f.limit] for f in first.verdict.findings],
        "reasons": [f.reason.value for f in verdict.findings],
        "findings": [[f.reason.value, f.value, f.limit] for f in verdict.findings],
        "tried": verdict.tried,
        "looks": sum(one.looks for one in tried),
        "handed_m": float(np.linalg.norm(last.at - last.picked)),
        "meant_m": float(np.linalg.norm(last.meant - last.picked)),
        "picked_safe": is_safe(rock, first.picked, arm, true),
        "trial_s": time.process_time() - began,
        "mast": _alignment_figures(last.laid, last.navcam, last.at),
    }
    if rendered or seed % 5 == 0:
        row |= _stereo_figures(last.rock, last.cloud, last.found)
    if verdict.accepted:
        return row | _touched(last, arm, true)
    row["safe_place"] = any(
        safe_place(one.rock, one.at, arm, limits, true) is not None
        for one in tried[:: max(1, len(tried) - 1)]
    )
    answer = arm.solve(last.at, (last.at - last.rock.centre) / np.linalg.norm(last.at - last.rock.centre))
    return row | {"in_reach": not isinstance(answer, ArmRefusal)}


def _touched(at: Attempt, arm: Arm, true: TrueLimits) -> dict[str, Any]:
    """Return where the tool truly came down after an accept, and what is wrong there."""
    verdict, rock = at.verdict, at.rock
    assert verdict.point is not None
    assert isinstance(verdict.posture, Posture)
    rng = np.random.default_rng([rock.seed, 0xA9])
    error = np.clip(0.5 * rng.standard_normal(3), -1.0, 1.0) * true.arm_error_m
    axis = -arm.tool_axis(verdict.posture.joints)
    patch = rock.true_patch(verdict.point, axis, arm.profile.tool_radius_m, true, error)
    start = verdict.point + error + 0.1 * axis
    touched = start - float(rock.scene.ranges(start, -axis[None])[0]) * axis
    return {
        "wrong": list(patch.wrong),
        "true_protrusion_m": patch.protrusion_m,
        "true_depth_m": patch.depth_m,
        "true_slope_rad": patch.slope_rad,
        "moved_m": verdict.distance_m,
        "measures": asdict(verdict.measures) if verdict.measures is not None else {},
        "error_m": float(np.linalg.norm(touched - at.picked)),
        "off_meant_m": float(np.linalg.norm(touched - at.meant)),
        "off_plan_m": float(np.linalg.norm(touched - verdict.point)),
    }


def _alignment_figures(laid: Alignment | None, navcam: RockView, at: Array) -> dict[str, float] | None:
    """Return how well the mast's cloud was laid on the hazcams', lengths in mm: what it says of itself, and
    how far the place of the tool (3,) is truly off, before and after.
    """
    if laid is None or navcam.told_from_true is None:
        return None
    one = navcam.seen[0]
    depth = float((at - one.C) @ one.A)
    baseline = float(np.linalg.norm(navcam.right.C - navcam.left.C))
    # a disparity that is off puts the place nearer or farther on its ray
    shift = 1.0 / (1.0 + navcam.off_px * depth / (one.hs * baseline))
    told = np.asarray(navcam.told_from_true.apply(one.C + shift * (at - one.C)))
    eye = np.asarray(navcam.told_from_true.apply(one.C))
    way = told - eye
    after = laid.motion.apply(eye + way * (1.0 + laid.stretch_per_m * float(np.linalg.norm(way))))
    return {
        "believed": float(laid.believed()),
        "residual_mm": 1000.0 * laid.residual_m,
        "overlap": laid.overlap,
        "sigma_mm": 1000.0 * laid.sigma_m,
        "before_mm": 1000.0 * float(np.linalg.norm(told - at)),
        "after_mm": 1000.0 * float(np.linalg.norm(after - at)),
    }


def _stereo_figures(rock: RockScene, cloud: SurfaceCloud, found: Segmentation) -> dict[str, Any]:
    """Return how well the rock's points are labelled, and what its disparities err.

    That is in milliradians: median, robust deviation, share beyond 4; and the share of the rock's pixels that
    have a point.
    """
    assert cloud.eye is not None
    ray = cloud.points - cloud.eye
    far = np.linalg.norm(ray, axis=1)
    hit = rock.scene.cast(np.broadcast_to(cloud.eye, ray.shape), ray / far[:, None])
    true = hit["tfar"].astype(np.float64)
    own = (true < 1e30) & (rock.scene.objects[np.maximum(hit["primID"], 0)] == rock.target_index)
    labels = np.unique(found.labels[own])
    shares = [
        float((own & (found.labels == k)).sum() / (own | (found.labels == k)).sum())
        for k in labels[labels >= 0]
    ]
    one, two, _, body, _ = rock.seen
    cosine = (ray @ one.A) / far
    baseline = float(np.linalg.norm(two.C - one.C))
    error = 1000.0 * baseline * (1.0 / (far * cosine) - 1.0 / (true * cosine))[own]
    middle = float(np.median(error))
    robust = 1.4826 * float(np.median(np.abs(error - middle)))
    cover = float(own.sum() * cloud.pitch_rad**2 * one.hs**2 / max(1, (body == rock.target_index).sum()))
    gross = float((np.abs(error - middle) > 4.0).mean())
    return {"iou": max(shares, default=0.0), "error_mrad": [middle, robust, gross, cover]}


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures of one kind of cloud."""
    rows = [r for r in rows if r["decision"] != "unseen"]
    accepted = [r for r in rows if "wrong" in r]
    refused = [r for r in rows if "wrong" not in r]
    unsafe = [r for r in accepted if r["wrong"]]
    false = [r for r in refused if r["safe_place"]]
    possible = len(accepted) - len(unsafe) + len(false)
    wanted = [r for r in rows if r["picked_safe"]]
    errors = np.array([r["error_m"] for r in accepted])
    taken = np.array([r["off_plan_m"] for r in accepted])
    laid = [r["mast"] for r in rows if r["mast"] is not None]
    return {
        "rocks": len(rows),
        "decisions": dict(Counter(r["decision"] for r in rows)),
        "unsafe": len(unsafe),
        "unsafe_why": dict(Counter(w for r in unsafe for w in r["wrong"])),
        "unsafe_seeds": [r["seed"] for r in unsafe],
        "picked_safe": len(wanted),
        "placed_on_it": sum(r["decision"] == "place" for r in wanted),
        "within_5_mm": sum(r.get("error_m", math.inf) <= ON_POINT_M for r in wanted),
        "within_5_mm_of_believed": sum(r.get("off_meant_m", math.inf) <= ON_POINT_M for r in wanted),
        "refused": len(refused),
        "false_refusals": len(false),
        "false_refusal_share": len(false) / max(1, possible),
        "false_decisions": dict(Counter(r["decision"] for r in false)),
        "first_reasons_of_refused": dict(Counter(r["reasons"][0] for r in refused).most_common()),
        "first_reasons_of_near": dict(
            Counter(r["reasons"][0] for r in accepted if r["decision"] == "place-near").most_common()
        ),
        "handed_off_mm": _quantiles(np.array([1000.0 * r["handed_m"] for r in rows])),
        "believed_off_mm": _quantiles(np.array([1000.0 * r["meant_m"] for r in rows])),
        "error_cm": _quantiles(100 * errors),
        "error_designated_cm": _quantiles(
            100 * errors[np.array([r["decision"] == "place" for r in accepted], dtype=bool)]
        ),
        "contact_off_plan_mm": _quantiles(1000 * taken),
        "iou": _quantiles(np.array([r["iou"] for r in rows if "iou" in r])),
        "iou_mean": float(np.mean([r["iou"] for r in rows if "iou" in r])),
        "disparity_mrad": np.mean([r["error_mrad"] for r in rows if "iou" in r], axis=0).round(3).tolist(),
        "mast_unbelieved": len(rows) - sum(int(one["believed"]) for one in laid),
        "mast_off_before_mm": _quantiles(np.array([one["before_mm"] for one in laid])),
        "mast_off_after_mm": _quantiles(np.array([one["after_mm"] for one in laid])),
        "stands": dict(Counter(r["stands"] for r in rows)),
        "placed_on_it_after_a_move": sum(r["decision"] == "place" and r["stands"] > 1 for r in wanted),
        "within_5_mm_after_a_move": sum(
            r.get("error_m", math.inf) <= ON_POINT_M and r["stands"] > 1 for r in wanted
        ),
        "looks_mean": float(np.mean([r["looks"] for r in rows])),
        "trial_s": _quantiles(np.array([r["trial_s"] for r in rows])),
    }


def _quantiles(values: Array) -> dict[str, float]:
    if not len(values):
        return {}
    marks = {"median": 0.5, "p90": 0.9, "p99": 0.99, "max": 1.0}
    return {name: round(float(np.quantile(values, q)), 3) for name, q in marks.items()}


def main() -> None:
    """Run the trials and write their rows, so that a run that was stopped goes on."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rocks", type=int, default=1000, help="with the cheap model of stereo")
    parser.add_argument("--rendered", type=int, default=120, help="with dense stereo on rendered pairs")
    parser.add_argument("--first-seed", type=int, default=EVALUATION)
    parser.add_argument("--folder", type=Path, default=Path("/tmp/outcrop-placement"))
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    result: dict[str, Any] = {"first_seed": options.first_seed}
    for kind, count in (("rendered", options.rendered), ("cast", options.rocks)):
        rows = _rows(options.folder / f"{kind}_{options.first_seed}.jsonl", options.first_seed, count, kind)
        if rows:
            result[kind] = summary(rows)
            print(kind, json.dumps(result[kind], indent=1), flush=True)
    if options.out is not None:
        options.out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


def _rows(path: Path, first: int, count: int, kind: str) -> list[dict[str, Any]]:
    known = {}
    if path.is_file():
        known = {row["seed"]: row for row in map(json.loads, path.read_text().splitlines())}
    with path.open("a", encoding="utf-8") as stream:
        for seed in range(first, first + count):
            if seed in known:
                continue
            known[seed] = trial(seed, kind == "rendered")
            stream.write(json.dumps(known[seed]) + "\n")
            stream.flush()
            if len(known) % 50 == 0:
                print(f"{kind}: {len(known)} of {count}", flush=True)
    return [known[seed] for seed in range(first, first + count)]


if __name__ == "__main__":
    main()
