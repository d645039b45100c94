"""A target found again after the rover has lost its pose, four hours later: see docs/results/tracking.md.

    python -m studies.reacquisition --worlds 70 --out docs          # fresh seeds, printed; writes the table
    python -m studies.reacquisition --worlds 70 --out docs --seed 734112 --resume     # go on after a stop
    python -m studies.reacquisition --worlds 10 --tuning            # seeds that constants were set on;
    writes nothing
    python -m studies.reacquisition --worlds 6 --step 0.35 --hours 6     # harder than it was built for

A world is a rock of 25 to 70 cm on generated ground, and three points of it by a plain rule: any that the
first picture shows, 3 px inside the outline. The rover has the navcam pair of its last stop. It believes to
have made a step of a tenth of the range, to 2 to 8 m; in truth it stands anywhere within a metre of there,
turned by up to 15 degrees. The sun has gone on by four hours. Each world is drawn by the own
renderer, with the grain of real frames, and by MuJoCo (needs `studies/offscreen.txt`; `--domains own draped`
does without). Right is a pixel within 1 px of where the true camera shows the point, wrong one that is told
as found and more than 3 px off.

Each is asked with and without the second opinion, and each kept pair is shown the pictures of the next world
as well, where nothing may be told. On the first ten worlds what the trackers had before is asked too: each
tracker with the whole frame, which is more than it looks at on the way, and the recall of kept pairs. Each
target is one line a method of `reacquired_SEED.jsonl`.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.handoff import Handoff, Side
from rover_iface.vision.handoff_cascade import cascade
from rover_iface.vision.learned import descriptor
from rover_iface.vision.narrow.recall import LAID
from rover_iface.vision.reacquisition import KnownPair, ReacquisitionOptions, SecondOpinion, reacquire
from rover_iface.vision.sift_features import Descriptors
from rover_iface.vision.tracker import Image, StereoView, TrackState
from rover_iface.vision.trackers import make_tracker
from studies.common.domain_split import Seeds, reporting, tuning
from studies.common.pages import table, write_section
from studies.common.perception_worlds import Shot
from studies.common.reacquisition_worlds import ASIDES, HOURS, SHARE, Trial, view_of
from studies.common.tracking_worlds import Array
from studies.domains import DOMAINS, RENDERED, SHARED

RIGHT_PX, WRONG_PX = 1.0, 3.0
Found = tuple[int, Array] | str
"""Which pair of the trial shows the target, and its pixel (2,); or why it is not told."""


@dataclass(frozen=True, slots=True)
class Entry:
    """What came of one target by one method; `error_px` is infinite where nothing was told.

    `asked` is in how many pictures the second opinion was.
    """

    method: str
    domain: str
    seed: int
    target: int
    range_m: float
    shift_m: float
    turn_deg: float
    in_sight: bool
    error_px: float
    seconds: float
    why: str
    asked: int = 0


class Counted:
    """The network, and how often it was asked."""

    calls = 0

    def __call__(self, image: Image, count: int) -> tuple[Array, Descriptors]:
        """Return pixels (n, 2) and descriptors (n, d)."""
        self.calls += 1
        return descriptor.detect(image, count)


class Looks:
    """What the mast can take in one trial: of three pairs that which points most to where it is asked."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.views: dict[int, StereoView] = {}

    def view(self, number: int) -> StereoView:
        """Return one of the pairs."""
        if number not in self.views:
            self.views[number] = view_of(self.trial.pair(number), self.trial.later_s)
        return self.views[number]

    def __call__(self, point: Array) -> StereoView:
        """Return the pair nearest to a point (3,), m.

        Raises
        ------
        TrackerError
            If the mast would have to turn by more than between two pairs.
        """
        first = self.view(0).left_camera
        bearing = _azimuth(point - first.C) - _azimuth(first.A)
        off = [abs(math.remainder(bearing - aside, math.tau)) for aside in ASIDES]
        best = int(np.argmin(off))
        if off[best] > ASIDES[1]:
            raise TrackerError(f"no pair within {math.degrees(off[best]):.0f} degrees of there")
        return self.view(best)


def _azimuth(ray: Array) -> float:
    return math.atan2(float(ray[1]), float(ray[0]))


def by_tracker(name: str) -> Callable[[KnownPair, Array, Looks], Found]:
    """Return a method: a registered tracker, whose next view is the pair towards the believed place."""

    def method(known: KnownPair, point: Array, looks: Looks) -> Found:
        tracker = make_tracker(name)
        try:
            tracker.start("T", point, known.side.view)
            update = tracker.update("T", looks.view(0))
        except TrackerError as err:
            return str(err)
        if update.state is not TrackState.TRACKED:
            return update.reasons[0]
        return 0, np.asarray(looks.view(0).left_camera.project(update.position))

    return method


def by_cascade(known: KnownPair, point: Array, looks: Looks) -> Found:
    """Return what the recall of kept pairs says (`narrow.recall`), between two wide pairs."""
    side, pixel = known.side, np.asarray(known.side.view.left_camera.project(point))
    scene = Side(looks.view(0), 0.6)
    answer = cascade(Handoff(scene, side.moved(Transform.identity()), pixel), "near", LAID)
    return (0, answer.pixel) if answer.accepted else answer.reasons[0]


def by_reacquisition(known: KnownPair, point: Array, looks: Looks) -> Found:
    """Return what ships."""
    found = reacquire(known, point, looks)
    if found.view is None:
        return found.reasons[0]
    return next(n for n, view in looks.views.items() if view is found.view), found.pixel


SHIPPED, ALONE, ELSEWHERE = "re-acquisition", "re-acquisition, SIFT alone", "shown another world"
ELSEWHERE_ALONE = f"{ELSEWHERE}, SIFT alone"
METHODS: dict[str, Callable[[KnownPair, Array, Looks], Found]] = {
    "correlation tracker": by_tracker("ncc"),
    "feature tracker": by_tracker("sift"),
    "recall of kept pairs": by_cascade,
    SHIPPED: by_reacquisition,
    ALONE: by_reacquisition,
}


class Kept:
    """What is known of the first stop of a trial, with and without the second opinion.

    `points` has the targets that its stereo ranges, (3,), m, by their number.
    """

    def __init__(self, trial: Trial) -> None:
        self.network, view = Counted(), view_of(trial.before)
        options = ReacquisitionOptions(second=SecondOpinion(self.network))
        self.known = KnownPair(view, options)
        self.alone = KnownPair(view, ReacquisitionOptions(second=None))
        seconds = []
        for pair in (self.known, self.alone):
            started = time.process_time()
            pair.prepare()
            seconds.append(time.process_time() - started)
        told = " s, without the second opinion in ".join(f"{spent:.1f}" for spent in seconds)
        print(f"  {trial.domain} {trial.seed}: pair kept in {told} s", flush=True)
        self.points: dict[int, Array] = {}
        for number, target in enumerate(trial.targets):
            match = self.known.side.point(np.asarray(trial.before[0].true.project(target)))
            if match is not None and match.score >= 0.7:  # else no tracker takes it
                self.points[number] = match.point


def measured(trial: Trial, kept: Kept, methods: list[str]) -> list[Entry]:
    """Return what each method makes of each target that stereo ranges in the first pair."""
    entries = []
    for number, point in kept.points.items():
        target = trial.targets[number]
        for method in methods:
            known = kept.alone if method == ALONE else kept.known
            found, entry = _asked(trial, kept, known, point, method)
            if not isinstance(found, str):
                entry = replace(entry, error_px=_error_px(trial.pair(found[0]), found[1], target))
            entries.append(replace(entry, target=number, in_sight=trial.in_sight(target)))
    return entries


def elsewhere(trial: Trial, kept: Kept) -> list[Entry]:
    """Return what is made of another world's target in a trial's pictures: whatever is told is wrong."""
    number, point = next(iter(kept.points.items()))
    pairs = {ELSEWHERE: kept.known, ELSEWHERE_ALONE: kept.alone}
    return [
        replace(_asked(trial, kept, known, point, method)[1], target=number)
        for method, known in pairs.items()
    ]


def _asked(trial: Trial, kept: Kept, known: KnownPair, point: Array, method: str) -> tuple[Found, Entry]:
    looks = Looks(trial)  # nothing is kept from one target to the next
    started, before_s, calls = time.process_time(), trial.taking_s, kept.network.calls
    found = METHODS.get(method, by_reacquisition)(known, point, looks)
    spent = time.process_time() - started - (trial.taking_s - before_s)
    return found, Entry(
        method=method,
        domain=trial.domain,
        seed=trial.seed,
        target=0,
        range_m=trial.range_m,
        shift_m=trial.shift_m,
        turn_deg=math.degrees(trial.turn_rad),
        in_sight=False,
        error_px=math.inf if isinstance(found, str) else WRONG_PX + 1.0,
        seconds=spent,
        why=found if isinstance(found, str) else "",
        asked=kept.network.calls - calls,
    )


def _error_px(pair: tuple[Shot, Shot], pixel: Array, target: Array) -> float:
    return float(np.hypot(*(pixel - pair[0].true.project(target))))


def report_table(entries: list[Entry]) -> str:
    """Return the table: targets in sight, and below them those that are hidden from every pair."""
    lines = []
    for domain in dict.fromkeys(e.domain for e in entries):
        for method in dict.fromkeys(e.method for e in entries):
            rows = [e for e in entries if (e.domain, e.method) == (domain, method)]
            there = [e for e in rows if e.in_sight]
            if not there:
                continue
            told = np.array([e.error_px for e in there if math.isfinite(e.error_px)])
            wrong = sum(math.isfinite(e.error_px) and e.error_px > WRONG_PX for e in rows)
            hidden = [e for e in rows if not e.in_sight]
            seconds = np.array([e.seconds for e in rows])
            right = sum(e.error_px <= RIGHT_PX for e in there)
            lines.append(
                [
                    method,
                    DOMAINS[domain],
                    f"{right} of {len(there)} ({100 * right / len(there):.1f} %)",
                    str(int((told > RIGHT_PX).sum())),
                    f"{len(there) - len(told)}",
                    f"{wrong} of {len(rows)}",
                    f"{sum(math.isfinite(e.error_px) for e in hidden)} of {len(hidden)}",
                    "" if not len(told) else f"{np.median(told):.2f} / {np.percentile(told, 95):.2f}",
                    f"{np.median(seconds):.2f} / {np.percentile(seconds, 95):.2f} / {seconds.max():.2f}",
                    str(sum(e.asked > 0 for e in rows)),
                ]
            )
    head = ["engine", "domain", "within 1 px, of those in sight", "1 px and more", "refused"]
    head += [
        "wrong (over 3 px)",
        "told though hidden",
        "px off: median / 95 %",
        "s of processor: median / 95 % / most",
        "second opinion asked",
    ]
    return table(head, lines)


def told_elsewhere(entries: list[Entry]) -> str:
    """Return in words what was made of pictures of another world."""
    rows, alone = ([e for e in entries if e.method == name] for name in (ELSEWHERE, ELSEWHERE_ALONE))
    told, asked = sum(math.isfinite(e.error_px) for e in rows), sum(e.asked > 0 for e in rows)
    most, before = (max((e.seconds for e in some), default=0.0) for some in (rows, alone))
    return (
        f"Shown another world: {told} of {len(rows)} told, the second opinion asked in {asked}; "
        f"{most:.2f} s at most for three pictures, {before:.2f} without it."
    )


def report(entries: list[Entry], seeds: Seeds, docs: Path) -> None:
    """Write the table into the page of results.

    Raises
    ------
    ValueError
        If the seeds are those that constants were set on.
    """
    seeds.require_reporting()
    head = ["git", "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(head, capture_output=True, text=True, check=True).stdout.strip()
    span = f"{seeds.values[0]} to {seeds.values[-1]}"
    note = f"Seeds {span}, drawn when the command ran; commit {commit}."
    text = f"{note} {told_elsewhere(entries)}\n\n{report_table(entries)}"
    write_section(docs, "tracking", "reacquisition", text)


def main() -> None:
    """Run the study."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--worlds", type=int, default=70)
    parser.add_argument("--seed", type=int)
    parser.add_argument("--tuning", action="store_true")
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("--compare", type=int, default=10, help="worlds on which the others are asked too")
    parser.add_argument("--methods", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--domains", nargs="+", choices=RENDERED, default=RENDERED)
    parser.add_argument("--step", type=float, default=SHARE, help="between the stops, share of the range")
    parser.add_argument("--hours", type=float, default=HOURS, help="between the stops")
    parser.add_argument("--imagery", type=Path, default=SHARED / "data/imagery")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()) / "reacquisition")
    arguments = parser.parse_args()
    chosen = tuning(arguments.worlds) if arguments.tuning else reporting(arguments.worlds, arguments.seed)
    print(f"{chosen.purpose} seeds {chosen.values}", flush=True)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    kept = arguments.folder / f"reacquired_{chosen.values[0]}.jsonl"
    entries: list[Entry] = []
    if arguments.resume and kept.is_file():
        entries = [Entry(**json.loads(line)) for line in kept.read_text().splitlines()]
    elif kept.is_file():
        kept.unlink()
    done = {(e.domain, e.seed) for e in entries}
    last: dict[str, Kept] = {}
    for number, seed in enumerate(chosen.values):
        for domain in arguments.domains:
            if (domain, seed) in done:
                continue
            trial = Trial(domain, seed, chosen.purpose, arguments.imagery, arguments.step, arguments.hours)
            methods = arguments.methods if number < arguments.compare else [SHIPPED, ALONE]
            pair = Kept(trial)
            if not entries:
                measured(trial, pair, methods)  # what is compiled at its first call is no part of the seconds
            found = measured(trial, pair, methods)
            if domain in last and last[domain].points:
                found += elsewhere(trial, last[domain])
            last[domain] = pair
            trial.close()
            with kept.open("a") as stream:
                stream.writelines(json.dumps(asdict(entry)) + "\n" for entry in found)
            entries += found
        if arguments.out is not None:
            report(entries, Seeds(chosen.purpose, chosen.values[: number + 1]), arguments.out)
    for entry in entries:
        if entry.method in (SHIPPED, ALONE) and not entry.error_px <= RIGHT_PX:
            print(entry)
    print(told_elsewhere(entries))
    print(report_table(entries))


if __name__ == "__main__":
    main()
