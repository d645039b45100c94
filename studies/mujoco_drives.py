"""The rover in MuJoCo: how fast it runs, and what drive times are worth before and after a calibration run.

Speed: one blind drive over generated ground of 128 m with posts of 5 cm, simulated seconds per processor
second.

Drive times: drives over level to rolling ground with few rocks, 2 to 5 m from place to place along free
straight paths, by the executive on the rover, recorded as runs. The planner's path network predicts mean and
spread of each; the band holds 80 % of a log-normal of these. *Before* are the figures of the rover profile;
*after* those fitted to the drives of one run (`outcrop mission calibrate` does the same). The judged drives
are on other ground with other grip of the wheels. All seeds follow from the one printed, drawn when none is
given.

::

    python -m studies.mujoco_drives --out docs
"""

from __future__ import annotations

import argparse
import json
import math
import secrets
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from executive.ports import Command, CommandId, Result
from ground.day.prepare import calibration_of, rover_parameters
from ground.resources.calibrations.driven_legs import DrivenLeg, calibrate, legs_of_run
from ground.uplink.flight import fly
from planner.path_network import Calibration, NetworkRequest, ObservationPoint, Pose, Target, build_network
from rover_iface.mujoco.rover import make_rover
from rover_iface.profile import load_profile
from rover_iface.terrain import Terrain, generate_terrain
from studies.common.pages import table, write_section

PROFILE = load_profile("k9")
Z_10 = 1.2815515655446004
"""Of the standard normal distribution, what a tenth lies beyond."""

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Speed:
    """How fast a drive was simulated: its seconds per processor second, and processor seconds to begin."""

    posts: int
    made_s: float
    ratio: float
    slip: float
    driven_m: float
    ended: str


def speed(seed: int) -> Speed:
    """Return the speed of a blind drive of 10 m on 128 m of ground at 5 cm."""
    terrain = generate_terrain(
        seed, 128.0, rock_cover=0.01, inner_m=128.0, spacing_m=0.05, crater=False, ortho=False
    )
    goal = next(place for place in _around((0.0, 0.0), 10.0) if _free(terrain, (0.0, 0.0), place))
    begin = time.process_time()
    rover = make_rover({"format": "world/1", "name": "speed"}, terrain=terrain, seed=seed)
    made_s = time.process_time() - begin
    begin = time.process_time()
    where = {"x": goal[0], "y": goal[1], "mode": "blind"}
    rover.send(Command(CommandId("speed", "drive", 1), "navigate", where))
    result = None
    while result is None:
        event = rover.next_event(None)
        result = event if isinstance(event, Result) else None
    ratio = rover.t_s / (time.process_time() - begin)
    slip = float(np.mean([slip for _, _, slip in rover.odometry if slip is not None]))
    driven = float(result.values["distance_m"])
    posts = rover.vehicle.field.heights.size
    return Speed(posts, made_s, ratio, slip, driven, result.reason or "at its goal")


def drives(seed: int, count: int, out: Path) -> tuple[list[DrivenLeg], Counter[str]]:
    """Return the legs of one run over a fresh site, and how its drives ended."""
    terrain = generate_terrain(seed, 48.0, rock_cover=0.01, inner_m=48.0, spacing_m=0.05, ortho=False)
    rng = np.random.default_rng([seed, 0xD1])
    here, goals = (0.0, 0.0), []
    while len(goals) < count:
        bearing, length = float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(2.0, 5.0))
        goal = (here[0] + length * math.cos(bearing), here[1] + length * math.sin(bearing))
        if max(map(abs, goal)) < 18.0 and _free(terrain, here, goal):
            goals.append(goal)
            here = goal
    world = {"format": "world/1", "name": f"drives-{seed}", "battery_j": 1e9}
    rover = make_rover(world, terrain=terrain, seed=seed, out=out)
    tasks = " ".join(
        f"(task :id drive-{k} :action navigate :continue-on-failure t :parameters (x = {x:.4f} y = {y:.4f}))"
        for k, (x, y) in enumerate(goals)
    )
    plan = f"(plan :id drives :node (block :id all :node-list ({tasks})))"
    fly(plan, rover, out, run_id=f"drives-{seed}", sync=False)
    ended: Counter[str] = Counter()
    for line in (out / "trace.jsonl").read_text("utf-8").splitlines():
        record = json.loads(line)
        if record[1] == "end" and str(record[2]).startswith("drive-"):
            ended[str(record[3])] += 1
    return legs_of_run(out), ended


def _around(middle: Place, radius_m: float) -> list[Place]:
    """Return 72 places on a circle."""
    angles = np.linspace(0.0, 2 * math.pi, 72, endpoint=False)
    return [
        (middle[0] + radius_m * math.cos(a), middle[1] + radius_m * math.sin(a)) for a in map(float, angles)
    ]


def _free(terrain: Terrain, here: Place, goal: Place) -> bool:
    """Return whether no rock lies within the rover's width of a path that is nowhere steeper than 15 deg."""
    count = max(2, math.ceil(math.dist(here, goal) / 0.25))
    xs, ys = np.linspace(here[0], goal[0], count), np.linspace(here[1], goal[1], count)
    if float(np.nanmax(terrain.slope(xs, ys))) > math.radians(15.0):
        return False
    return not any(
        rock.diameter > 0.1 and math.hypot(rock.x - x, rock.y - y) < 0.8 + rock.diameter / 2
        for x, y in zip(map(float, xs), map(float, ys), strict=True)
        for rock in terrain.rocks_near(x, y, 2.0)
    )


def band(leg: DrivenLeg, model: Calibration) -> tuple[float, float, float]:
    """Return the mean time that the path network gives a leg, and the ends of its 80 % band, seconds."""
    network = build_network(
        NetworkRequest(
            start=Pose(*leg.begin),
            targets=(Target("T", leg.end[0], leg.end[1], 0.0, False),),
            observation_points=(ObservationPoint("stand", "T", Pose(*leg.end)),),
            terrain=None,
            rover=rover_parameters(PROFILE),
            calibration=model,
        )
    )
    route = network.route("start", "stand")
    assert route is not None, "nothing is in the way of a straight drive"
    spread = math.sqrt(math.log1p((route.duration_sd_s / route.duration_mean_s) ** 2))
    middle = math.log(route.duration_mean_s) - spread**2 / 2
    return route.duration_mean_s, math.exp(middle - Z_10 * spread), math.exp(middle + Z_10 * spread)


def judged(name: str, legs: Sequence[DrivenLeg], model: Calibration) -> list[str]:
    """Return the row of a model: how many drives its band covers, and how far its means are off."""
    bands = [band(leg, model) for leg in legs]
    times = np.array([leg.duration_s for leg in legs])
    inside = sum(low <= t <= high for t, (_, low, high) in zip(times, bands, strict=True))
    means = np.array([mean for mean, _, _ in bands])
    width = float(np.median([(high - low) / mean for mean, low, high in bands]))
    energy = np.array([leg.energy_j for leg in legs])
    power = rover_parameters(PROFILE).drive_power_w
    used = float(np.sum(model.energy_factor * power * means) / energy.sum())
    return [
        name,
        f"{inside} of {len(legs)}",
        f"{float(np.mean(means / times)):.2f}",
        f"{width:.2f}",
        f"{used:.2f}",
    ]


def main() -> None:
    """Measure, print, and with --out put the tables into the docs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seed", type=int, help="fresh ones are drawn when absent")
    parser.add_argument("--learn", type=int, default=20, help="drives of the calibration run")
    parser.add_argument("--runs", type=int, default=10, help="judged runs")
    parser.add_argument("--drives", type=int, default=10, help="drives of each")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--out", type=Path, help="docs folder: results/mujoco.md")
    arguments = parser.parse_args()
    seed = secrets.randbelow(900_000) + 1000 if arguments.seed is None else arguments.seed
    print(f"seed {seed}: speed and calibration run {seed}, judged runs {seed + 1} to {seed + arguments.runs}")
    fast = speed(seed)
    print(f"{fast.ratio:.1f} times real time", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        seeds = [seed + k for k in range(arguments.runs + 1)]
        counts = [arguments.learn, *[arguments.drives] * arguments.runs]
        outs = [Path(folder) / str(number) for number in seeds]
        legs: list[DrivenLeg] = []
        ended: Counter[str] = Counter()
        with ProcessPoolExecutor(arguments.jobs) as pool:
            for number, (more, how) in zip(seeds, pool.map(drives, seeds, counts, outs), strict=True):
                print(f"run {number}: {dict(how)}", flush=True)
                legs += more
                ended += how
        learned, legs = legs[: arguments.learn], legs[arguments.learn :]
    after = calibrate(learned, PROFILE, name="mujoco", source=f"{len(learned)} drives of one run in MuJoCo")
    arrived = [leg for leg in legs if leg.arrived]
    rows = [
        judged("before: the profile's", arrived, calibration_of(PROFILE)),
        judged("after one calibration run", arrived, after),
    ]
    head = [
        "model",
        "in the 80 % band",
        "mean predicted / driven",
        "width of the band / mean",
        "energy / used",
    ]
    text = (
        f"`python -m studies.mujoco_drives --seed {seed} --learn {arguments.learn} --runs {arguments.runs} "
        f"--drives {arguments.drives}`: speed and calibration run have the seed {seed}, judged runs "
        f"{seed + 1} to {seed + arguments.runs}.\n\n"
        + table(
            ["128 m of ground, posts of 5 cm", ""],
            [
                ["posts", f"{fast.posts:,}"],
                ["processor seconds to make the rover", f"{fast.made_s:.1f}"],
                ["simulated seconds per processor second, one core", f"{fast.ratio:.1f}"],
                ["driven, mean slip, ended", f"{fast.driven_m:.1f} m, {100 * fast.slip:.1f} %, {fast.ended}"],
            ],
        )
        + f"\nDrives that arrived: {len(arrived)} of {len(legs)} judged ones; only these have a time. The "
        + f"ends of all drives, those of the calibration run too: {dict(ended)}.\n\n"
        + table(head, rows)
        + f"\nLearned from {after.legs} drives: {after.fixed_s:.0f} s a drive, {after.drive_factor:.2f} "
        + f"times the time by speed, {after.turn_factor:.2f} times that by turn rate, spread "
        + f"{100 * after.duration_cv:.1f} %; energy {after.energy_factor:.3f} times the profile's drive "
        + "power.\n"
    )
    print(text)
    if arguments.out is not None:
        write_section(arguments.out, "mujoco", "mujoco", text)


if __name__ == "__main__":
    main()
