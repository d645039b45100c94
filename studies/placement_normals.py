"""How far the normal under the tool is off, against what the narrow look tells of it.

`python -m studies.placement_normals --rocks 40 --first-seed 45000`

On each rock of the study of placements the narrow pair looks at the designated point and at some places
beside it, drawn uniformly. Of each place that it shows to be good the told normal is compared with that of
the true surface, cast on the triangles: the angle, in told deviations, and how steep the surface truly is to
the tool where slope and spread are let in. Rendered pairs, as in `studies.placement`.
"""

from __future__ import annotations

import argparse
import json
import math
from dataclasses import dataclass, replace

import numpy as np

from rover_iface.placement import SafetyLimits, segment
from rover_iface.placement.arm import Arm, Posture
from rover_iface.placement.cloud_alignment import align
from rover_iface.placement.joint_check import JointCheck
from rover_iface.placement.narrow_looks import NarrowLooks
from rover_iface.placement.patch_check import PatchCheck
from rover_iface.placement.second_labels import SECOND_EDGE_PX, second_labels
from rover_iface.placement.segmentation import GROUND, SegmentationOptions
from rover_iface.profile import load_profile
from studies.common.placement_rocks import rock_scene
from studies.common.true_surface import TrueLimits
from studies.placement import MAST_SEED, designated, narrow_look

PLACES, EVERY, ROUND_M = 3, 3, 0.024
"""Places beside the designated point that are looked at; of what lies so near each, every third is judged."""


@dataclass(frozen=True, slots=True)
class Place:
    """One place: the true angle between told and true normal, what is told of it, what the arm leaves, the
    true angle between tool and surface, rad, and what is wrong there.
    """

    off_rad: float
    sigma_rad: float
    tilt_rad: float
    slope_rad: float
    wrong: tuple[str, ...]


def places(seed: int) -> list[Place]:
    """Return the places of one rock that a narrow look shows to be good and the arm reaches."""
    profile, limits, true = load_profile("k9"), SafetyLimits(), TrueLimits()
    rock, arm = rock_scene(seed), Arm(profile.arm)
    if not (rock.seen[3] == rock.target_index).any():
        return []
    at = designated(rock)[1]
    cloud = rock.hazcam.rendered_cloud(seed)
    laid = align(rock.navcam(at).rendered_cloud(seed + MAST_SEED), cloud)
    if laid is None or not laid.believed():
        return []
    found = segment(cloud, SegmentationOptions())
    label = int(found.labels[int(cloud.tree.query(at)[1])])
    if label == GROUND:
        return []
    labels = second_labels(laid.cloud, at, cloud, found, label)
    second = PatchCheck(laid.cloud, labels, label, profile, replace(limits, edge_px=SECOND_EDGE_PX))
    check = JointCheck([PatchCheck(cloud, found.labels, label, profile, limits), second])
    looks = NarrowLooks(check, narrow_look(rock, cloud, laid), profile)
    rng = np.random.default_rng([seed, 0x40A1])
    around = check.candidates(at, coarse=1.0)
    out = []
    for middle in [at, *(around[k] for k in rng.permutation(len(around))[:PLACES])]:
        looks.opinion(middle, anew=True)
        for point in [one for one in around if np.linalg.norm(one - middle) < ROUND_M][::EVERY]:
            good = looks.opinion(point).judged
            if good is None or good.normal is None or good.measures is None:
                continue
            answer = arm.solve(good.point, good.normal)
            if not isinstance(answer, Posture):
                continue
            radius = profile.arm.tool_radius_m
            off = rock.true_patch(good.point, good.normal, radius, true).slope_rad
            met = rock.true_patch(good.point, -arm.tool_axis(answer.joints), radius, true)
            out.append(
                Place(off, good.measures.normal_sigma_rad, answer.tool_tilt_rad, met.slope_rad, met.wrong)
            )
    return out


def summary(found: list[Place]) -> dict[str, object]:
    """Return how the told deviations hold, and how steep and how bad what is let in truly is."""
    limits = SafetyLimits()
    off = np.array([one.off_rad for one in found])
    told = np.array([one.sigma_rad for one in found])
    plain = math.radians(1.0)
    out: dict[str, object] = {
        "places": len(found),
        "off_deg": np.degrees(np.quantile(off, (0.5, 0.9, 0.99, 1.0))).round(1).tolist(),
        "told_deg": np.degrees(np.quantile(told, (0.1, 0.5, 0.9, 0.99))).round(1).tolist(),
        "within_2_and_3": [round(float((off <= k * told).mean()), 3) for k in (2, 3)],
        "within_2_and_3_degrees": [round(float((off <= k * plain).mean()), 3) for k in (2, 3)],
    }
    for sigmas in (limits.sigmas, limits.beside_sigmas):
        kept = [one for one in found if one.tilt_rad + sigmas * one.sigma_rad <= limits.most_slope_rad]
        out[f"kept_at_{sigmas:g}"] = {
            "places": len(kept),
            "steepest_deg": round(math.degrees(max((one.slope_rad for one in kept), default=0.0)), 1),
            "wrong": sum(bool(one.wrong) for one in kept),
        }
    return out


def main() -> None:
    """Print the figures, and the seeds that they are of."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--rocks", type=int, default=40)
    parser.add_argument("--first-seed", type=int, default=45_000)
    options = parser.parse_args()
    seeds = range(options.first_seed, options.first_seed + options.rocks)
    found = [place for seed in seeds for place in places(seed)]
    print(json.dumps({"seeds": [seeds[0], seeds[-1]], **summary(found)}, indent=1))


if __name__ == "__main__":
    main()
