"""Calibration from recorded runs of the `subframe` rover, and whether its odds hold on other sites.

    .venv/bin/python -m studies.calibration --cache var/calibration [--out docs]

Training: more than 200 runs on 12 sites (of 240 starts some find no room). In each the rover starts to track
two targets on rocks in its view and drives: every third time to the first of them, else to a place 3 m away;
the ground has rocks that the planner's map has not. The legs of the recorded runs give the calibration
(`ground/driven_legs.py`). Evaluation: runs on other sites. There the path network, with that
calibration and the map, says for each run with what chance each track is lost on the way; what was lost is
counted beside it. Runs are kept in the cache, so the script can be interrupted, and run
twice at once (`--half 0`, `--half 1`).
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ground.day.prepare import calibration_of, network_heights, rover_parameters
from ground.resources.calibrations.driven_legs import DrivenLeg, calibrate, legs_of_run
from ground.uplink.flight import fly
from planner.path_network import (
    CALIBRATIONS,
    Calibration,
    NetworkRequest,
    ObservationPoint,
    Pose,
    Target,
    build_network,
)
from rover_iface.errors import PlacementError, WorldError
from rover_iface.frames import Pose as Stand
from rover_iface.mobility import settled_pose
from rover_iface.navigation.kernels import cast_ranges
from rover_iface.navigation.sensor import GroundRaster, StereoSensor
from rover_iface.placement import place_base
from rover_iface.profile import load_profile
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.renderer import Renderer
from rover_iface.simulator.subframe_rover import make_rover
from rover_iface.terrain import Terrain, generate_terrain
from rover_iface.terrain.strew import add_rocks
from studies.common.pages import write_section

TRAIN, TEST = 1000, 2000
UNMAPPED_PER_M2 = 0.02
PROFILE = load_profile("k9")


@dataclass(frozen=True, eq=False)
class Site:
    """The planner's map, the true ground, and an eye for it."""

    map: Terrain
    terrain: Terrain
    ground: GroundRaster
    renderer: Renderer


@lru_cache(maxsize=32)
def map_of(seed: int) -> Terrain:
    """Return the planner's map of a site; rocks cover 3 to 7 % of it."""
    cover = float(np.random.default_rng([seed, 0xCA1]).uniform(0.03, 0.07))
    return generate_terrain(
        seed, 40.0, rock_cover=cover, inner_m=24.0, inner_spacing_m=0.05, spacing_m=0.1, crater=False,
        outcrop=False, ortho=False,
    )  # fmt: skip


@lru_cache(maxsize=1)
def site_of(seed: int) -> Site:
    """Return a site: its map, and ground with rocks that the map has not."""
    known = map_of(seed)
    rng = np.random.default_rng([seed, 0xCA1])
    rng.uniform()
    count = int(rng.poisson(UNMAPPED_PER_M2 * 20 * 20))
    table = np.column_stack([rng.uniform(-10, 10, (count, 2)), rng.uniform(0.2, 0.5, count)])
    true = add_rocks(known, table, seed=seed, keep_clear=(), prefix="U")
    scene = scene_from_terrain(true, (0.0, 0.0), radius_m=15.0)
    return Site(known, true, GroundRaster.of(true, 15.0), Renderer(scene))


def world_of(seed: int, number: int) -> dict[str, Any] | None:
    """Return the world of a run: a start, two targets on rocks seen from there, and where to drive."""
    site = site_of(seed)
    rng = np.random.default_rng([seed, number, 0xCA2])
    approach = number % 3 == 0
    for _ in range(80):
        x, y = map(float, rng.uniform(-6, 6, 2))
        heading = float(rng.uniform(-math.pi, math.pi))
        if not _free(site, x, y):
            continue
        stand = settled_pose(site.terrain, PROFILE, x, y, heading)
        targets = list(_targets(site, stand, rng, approach))
        bearing = heading + float(rng.uniform(-1.5, 1.5))
        goal = x + 3.0 * math.cos(bearing), y + 3.0 * math.sin(bearing)
        if len(targets) < 2 or not (approach or _free(site, *goal)):
            continue
        return {
            "format": "world/1",
            "name": f"{seed}-{number}",
            "start": {"east_m": x, "north_m": y, "heading_rad": heading},
            "targets": targets,
            "map_error": {"unmapped_rocks_per_m2": 0, "softer": 1.2},
            "battery_j": 4_000_000,
        } | ({} if approach else {"goal": goal})
    return None


def _free(site: Site, x: float, y: float) -> bool:
    return all(
        math.hypot(r.x - x, r.y - y) > 0.75 + r.diameter / 2 for r in site.terrain.rocks_near(x, y, 2.0)
    )


def _targets(site: Site, stand: Stand, rng: np.random.Generator, approach: bool) -> Iterator[dict[str, Any]]:
    """Yield two targets in sight of a stand; one that is approached is near and within the arm's reach."""
    eye = stand.site_from_rover.apply(StereoSensor(PROFILE).eye)
    g = site.ground
    found = 0
    for rock in rng.permutation(np.array(site.map.rocks_near(stand.x, stand.y, 8.0), dtype=object)):
        away = math.hypot(rock.x - stand.x, rock.y - stand.y)
        side = abs(math.remainder(math.atan2(rock.y - stand.y, rock.x - stand.x) - stand.heading, math.tau))
        near = approach and not found
        if not (2.6 <= away <= (4.2 if near else 8.0) and 0.25 <= rock.diameter <= 0.8 and side < 2.6):
            continue
        if max(abs(rock.x), abs(rock.y)) > 9.5:
            continue
        way = np.array([rock.x, rock.y, rock.z + 0.5 * rock.height]) - eye
        way /= np.linalg.norm(way)
        range_m = float(cast_ranges(g.heights, g.west, g.south, g.spacing, eye, way[None], 12.0)[0])
        point = eye + range_m * way
        if not math.hypot(rock.x - point[0], rock.y - point[1]) < 0.5 * rock.diameter:
            continue
        target: dict[str, Any] = {"id": f"T{found + 1}", "point_m": [float(v) for v in point]}
        if near:
            try:
                best = place_base(site.map, PROFILE, target["point_m"], start=stand, count=1)[0].pose
            except PlacementError:
                continue
            target["observation_point"] = {
                "east_m": best.x,
                "north_m": best.y,
                "heading_rad": best.heading,
            }
        yield target
        found += 1
        if found == 2:
            return


def record(seed: int, number: int, cache: Path) -> Path | None:
    """Return the folder of a recorded run, made if the cache has it not; None where the site has no room."""
    out = cache / f"{seed}-{number}"
    if (out / "done").exists():
        return out if (out / "journal.jsonl").exists() else None
    world = world_of(seed, number)
    goal = None if world is None else world.pop("goal", None)
    out.mkdir(parents=True, exist_ok=True)
    for left in (*out.glob("*.jsonl"), *out.glob("*.json")):
        left.unlink()
    if world is not None:
        try:
            rover = make_rover(world, terrain=site_of(seed).terrain, seed=100 * seed + number, out=out)
        except WorldError:
            world = None
    if world is not None:
        rover.body.renderer = site_of(seed).renderer
        names = [target["id"] for target in world["targets"]]
        where = f"target = {names[0]}" if goal is None else f"x = {goal[0]:.4f} y = {goal[1]:.4f}"
        tasks = [
            *(f"(task :id track-{n} :action trackstart :continue-on-failure t :parameters (target = {n}))"
              for n in names),
            f"(task :id drive :action navigate :parameters ({where} mode = track))",
        ]  # fmt: skip
        plan = f"(plan :id approach :node (block :id all :node-list ({' '.join(tasks)})))"
        fly(plan, rover, out, run_id=f"{seed}-{number}", sync=False)
        (out / "world.json").write_text(json.dumps({**world, "goal": goal}) + "\n", encoding="utf-8")
    (out / "done").touch()
    return out if world is not None else None


def predicted(
    leg: DrivenLeg, world: dict[str, Any], known: Terrain, model: Calibration
) -> tuple[dict[str, float], float | None]:
    """Return the chance that the path network gives each track of a drive to be lost, and its mean time."""
    start = world["start"]
    first = world["targets"][0]
    stand = first.get("observation_point")
    if stand is None:  # a place without a heading: the rover arrives as it drove
        x, y = world["goal"]
        stand = {
            "east_m": x,
            "north_m": y,
            "heading_rad": math.atan2(y - start["north_m"], x - start["east_m"]),
        }
    goal = Pose(stand["east_m"], stand["north_m"], stand["heading_rad"])
    tracked = {track.target for track in leg.tracks}
    network = build_network(
        NetworkRequest(
            start=Pose(start["east_m"], start["north_m"], start["heading_rad"]),
            targets=tuple(
                Target(t["id"], x, y, z, t["id"] in tracked)
                for t in world["targets"]
                for x, y, z in [t["point_m"]]
            ),
            observation_points=(ObservationPoint("stand", first["id"], goal),),
            terrain=network_heights(
                known,
                [
                    (start["east_m"], start["north_m"]),
                    *((t["point_m"][0], t["point_m"][1]) for t in world["targets"]),
                ],
            ),
            rover=rover_parameters(PROFILE),
            calibration=model,
        )
    )
    route = network.route("start", "stand")
    return ({}, None) if route is None else (dict(route.p_lose), route.duration_mean_s)


def runs_of(
    base: int, runs: int, per_site: int, cache: Path, half: int | None = None, made_only: bool = False
) -> Iterator[tuple[int, Path]]:
    """Yield the sites and folders of recorded runs, made where the cache has them not."""
    begun, made = time.process_time(), 0
    for number in range(runs):
        seed, turn = base + number // per_site, number % per_site
        if half is not None and seed % 2 != half:
            continue
        new = not (cache / f"{seed}-{turn}" / "done").exists()
        if new and made_only:
            continue
        folder = record(seed, turn, cache)
        if new:
            made += 1
            print(f"{seed}-{turn}: {(time.process_time() - begun) / made:.1f} CPU s a run", flush=True)
        if folder is not None:
            yield seed, folder


@dataclass(frozen=True, slots=True)
class Odds:
    """One track of an evaluation run: chance of loss before and after calibration, and what became of it."""

    before: float
    after: float
    lost: bool


def evaluated(
    folders: list[tuple[int, Path]], before: Calibration, after: Calibration
) -> tuple[list[Odds], list[tuple[float, float]]]:
    """Return the odds of every track, and predicted and measured seconds of every drive that arrived."""
    odds, times = [], []
    overhead = rover_parameters(PROFILE).track_overhead_s
    for seed, folder in folders:
        world = json.loads((folder / "world.json").read_text("utf-8"))
        for leg in legs_of_run(folder):
            said = [predicted(leg, world, map_of(seed), model) for model in (before, after)]
            odds += [
                Odds(said[0][0][track.target], said[1][0][track.target], track.lost)
                for track in leg.tracks
                if all(track.target in chances for chances, _ in said)
            ]
            if leg.arrived and said[1][1] is not None:
                times.append((said[1][1] + overhead * len(leg.tracks), leg.duration_s))
    return odds, times


EDGES = (0.0, 0.05, 0.1, 0.2, 0.4, 1.0)


def binned(odds: list[Odds]) -> list[tuple[str, int, float, int, float]]:
    """Return range of predicted chance, tracks, losses expected and seen, their distance in deviations."""
    rows = []
    for low, high in (*pairwise(EDGES), (0.0, 1.0)):
        chances = np.array([o.after for o in odds if low <= o.after < high or high == o.after == 1.0])
        seen = sum(o.lost for o in odds if low <= o.after < high or high == o.after == 1.0)
        if len(chances) == 0:
            continue
        deviation = math.sqrt(float((chances * (1 - chances)).sum()))
        name = "all" if (low, high) == (0.0, 1.0) else f"{100 * low:.0f} to {100 * high:.0f} %"
        rows.append((name, len(chances), float(chances.sum()), int(seen), (seen - chances.sum()) / deviation))
    return rows


def table(
    model: Calibration, odds: list[Odds], times: list[tuple[float, float]], runs: tuple[int, int]
) -> str:
    """Return the calibration and how its odds held, in Markdown."""
    prior = calibration_of(PROFILE)
    lines = [
        f"| {runs[0]} training runs, {model.losses} of {model.tracks} tracks lost | before | calibrated |",
        "| --- | --- | --- |",
    ]
    for where in ("inside", "outside", "occluded"):
        rate, error = getattr(model, f"{where}_per_m"), getattr(model, f"{where}_se_per_m")
        told = f"{rate:.4f} +- {error:.4f}" if error else f"{rate:.4f} (not seen)"
        lines.append(f"| lost tracks per metre, {where} | {getattr(prior, f'{where}_per_m'):.4f} | {told} |")
    lines += [
        f"| fixed time of a leg | {prior.fixed_s:.0f} s | {model.fixed_s:.0f} s |",
        f"| time over driving time | {prior.drive_factor:.1f} | {model.drive_factor:.1f} |",
        f"| spread of time (cv) | {prior.duration_cv:.2f} | {model.duration_cv:.2f} |",
        f"| energy over drive power x time | {prior.energy_factor:.2f} | {model.energy_factor:.2f} |",
        f"| spread of energy (cv) | {prior.energy_cv:.2f} | {model.energy_cv:.2f} |",
        "",
        f"| predicted chance, {runs[1]} runs on other sites | tracks | losses expected | seen | deviations |",
        "| --- | --- | --- | --- | --- |",
    ]
    rows = binned(odds)
    for name, count, expected, seen, z in rows:
        lines.append(f"| {name} | {count} | {expected:.1f} | {seen} | {z:+.1f} |")
    square = sum(z * z for name, *_, z in rows if name != "all")
    uncalibrated = sum(o.before for o in odds)
    lines += [
        "",
        f"Chi-square {square:.1f} over {len(rows) - 1} bins; the rover profile had expected "
        f"{uncalibrated:.1f}\nlosses.",
    ]
    if times:
        said, took = np.array(times).T
        lines[-1] += (
            f" Drives took {took.mean():.0f} s in the mean, {said.mean():.0f} s predicted "
            f"(standard\nerror of the measured mean {took.std() / math.sqrt(len(took)):.0f} s, "
            f"{len(took)} drives)."
        )
    return "\n".join(lines)


def plot(odds: list[Odds], path: Path) -> None:
    """Draw seen shares of lost tracks over predicted ones, with three deviations."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5.2, 5), layout="constrained")
    rows = [row for row in binned(odds) if row[0] != "all"]
    p = np.array([expected / count for _, count, expected, _, _ in rows])
    share = np.array([seen / count for _, count, _, seen, _ in rows])
    count = np.array([row[1] for row in rows])
    three = 3 * np.sqrt(p * (1 - p) / count)
    low = np.minimum(three, p)
    axes.errorbar(p, p, yerr=[low, three], fmt="none", color="0.6", capsize=3, label="three deviations")
    axes.plot([0, 1], [0, 1], "k--", lw=1, label="as predicted")
    axes.plot(p, share, "o", color="tab:blue", label="seen")
    for x, y, (_, tracks, _, seen, _) in zip(p, share, rows, strict=True):
        axes.annotate(f"{seen} of {tracks}", (x, y), textcoords="offset points", xytext=(7, 5))
    axes.set(
        xlabel="predicted chance that a track is lost",
        ylabel="share of tracks lost on other sites",
        xlim=(0, min(1.0, 1.4 * float(p.max()))),
        ylim=(0, min(1.0, 1.1 * float((p + three).max()))),
    )
    axes.legend(loc="upper left")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Make the runs, fit, evaluate, and with --out put table and plot into the docs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--train", type=int, default=240)
    parser.add_argument("--test", type=int, default=100)
    parser.add_argument("--half", type=int, choices=(0, 1), help="make only the runs of every other site")
    parser.add_argument("--made", action="store_true", help="make no runs; take what the cache has")
    parser.add_argument(
        "--out", type=Path, help="docs folder: img/calibration.png, table in results/path-network.md"
    )
    arguments = parser.parse_args()
    cache = arguments.cache
    train = list(runs_of(TRAIN, arguments.train, 20, cache, arguments.half, arguments.made))
    test = list(runs_of(TEST, arguments.test, 10, cache, arguments.half, arguments.made))
    if arguments.half is not None:
        return
    legs = [leg for _, folder in train for leg in legs_of_run(folder)]
    maps = {folder.name: map_of(seed) for seed, folder in train}
    prior = calibration_of(PROFILE)
    model = calibrate(
        legs,
        PROFILE,
        maps,
        name="subframe",
        source=f"{len(train)} recorded runs of the subframe rover on generated sites",
    )
    (cache / "calibration.json").write_text(CALIBRATIONS.write(model, indent=2) + "\n", encoding="utf-8")
    odds, times = evaluated(test, prior, model)
    text = table(model, odds, times, (len(train), len(test)))
    print(text)
    if arguments.out is not None:
        plot(odds, arguments.out / "img" / "calibration.png")
        write_section(arguments.out, "path-network", "calibration", text)


if __name__ == "__main__":
    main()
