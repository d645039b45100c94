"""The table of the contest."""

from __future__ import annotations

import argparse
import hashlib
import pickle
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from rover_iface.vision.learned.descriptor import Net
from studies.common.domain_split import Seeds, reporting, tuning
from studies.common.pages import table, write_section
from studies.domains import DOMAINS
from studies.learned_matcher.contest import NAMES, NETWORK, RATIOS, SIFT, Outcome, outcomes, ratio_like, sums
from studies.learned_matcher.sights import Sight, photograph_sights, rendered_sight, warped_sights

ASKED = {**DOMAINS, "photographs": "(c) photographs of a boulder"}
BOULDER = "sequences/apollo17_boulder_138"
Found = dict[str, list[list[Outcome]]]
"""By domain, the outcomes of each sight."""


def sights_of(domain: str, seed: int, arguments: argparse.Namespace) -> Iterator[Sight]:
    """Return the sights of one seed in a domain; photographs have none."""
    if domain == "photographs":
        return photograph_sights(arguments.imagery / BOULDER)
    if domain == "warped":
        return warped_sights(seed, arguments.purpose, arguments.imagery)
    return rendered_sight(domain, seed, arguments.purpose, arguments.imagery)


def kept(domain: str, seed: int, name: str, arguments: argparse.Namespace, net: Net) -> list[list[Outcome]]:
    """Return the outcomes of a seed, worked out now or kept by an earlier run with the same network."""
    path: Path = arguments.folder / f"contest_{name}_{domain}_{arguments.purpose}_{seed}.pickle"
    if path.is_file():
        with path.open("rb") as stream:
            found: list[list[Outcome]] = pickle.load(stream)
        return found
    found = [outcomes(sight, net) for sight in sights_of(domain, seed, arguments)]
    part = path.with_suffix(".part")
    with part.open("wb") as stream:
        pickle.dump(found, stream)
    part.replace(path)
    counts = [{one.method: one.count() for one in sight} for sight in found]
    print(f"  {domain} {seed}: {[(c[SIFT], c[NETWORK]) for c in counts]}", flush=True)
    return found


def of_method(found: list[list[Outcome]], name: str) -> list[Outcome]:
    """Return the outcomes of one method."""
    return [one for sight in found for one in sight if one.method == name]


def report_table(found: Found) -> str:
    """Return the table."""
    lines = []
    for domain in sorted(found, key=lambda name: ASKED[name]):
        if not found[domain]:
            continue
        sift = [one.count()[0] for one in of_method(found[domain], SIFT)]
        for name in NAMES:
            own = of_method(found[domain], name)
            total = sums(own)
            more = sum(one.count()[0] > other for one, other in zip(own, sift, strict=True))
            asked = own[0].agree is not None
            precise = 100 * total.right / max(1, total.right + total.wrong)
            lines.append(
                [
                    name,
                    ASKED[domain],
                    f"{total.right} of {total.shown}",
                    f"{total.wrong}",
                    f"{precise:.1f}",
                    f"{100 * total.curve:.1f}",
                    "" if name == SIFT else f"{more} of {total.sights}",
                    f"{np.median(total.agree):.0f} / {min(total.agree)}" if asked else "",
                    f"{total.posed} of {total.sights}, {total.misled}" if asked else "",
                    f"{np.median(total.seconds):.2f}",
                ]
            )
    head = ["matched by", "domain", "within 1 px, of those shown", "over 3 px", "precision, %"]
    head += [
        "right at 95 % precision, %",
        "more right than the product",
        "agree on a pose: median / least",
        "poses within reach, beyond",
        "s of processor, median",
    ]
    return table(head, lines)


def make_table(arguments: argparse.Namespace) -> None:
    """Hold the contest on seeds of its own, print the table and write it into the page of results."""
    chosen = tuning(arguments.worlds) if arguments.tuning else reporting(arguments.worlds, arguments.seed)
    print(f"{chosen.purpose} seeds {chosen.values}", flush=True)
    arguments.purpose = chosen.purpose
    path: Path = arguments.network
    head = ["git", "rev-parse", "--short", "HEAD"]
    commit = subprocess.run(head, capture_output=True, text=True, check=True).stdout.strip()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    name, net = hashlib.sha256(path.read_bytes()).hexdigest()[:12], Net.read(path)
    domains = arguments.domains or [d for d in ASKED if not (arguments.tuning and d == "photographs")]
    found: Found = {domain: [] for domain in domains}
    if "photographs" in domains:
        found["photographs"] = kept("photographs", 0, name, arguments, net)
    for seed in chosen.values:
        for domain in (d for d in domains if d != "photographs"):
            found[domain] += kept(domain, seed, name, arguments, net)
    text = report_table(found)
    print(text)
    if arguments.tuning:
        everything = [sight for sights in found.values() for sight in sights]
        for method in (n for n in NAMES if n in RATIOS):
            like = ratio_like(of_method(everything, method), of_method(everything, SIFT))
            print(f"{method}: as precise as the product up to a ratio of {like * RATIOS[method]:.3f}")
    if arguments.out is not None:
        report(text, chosen, name, commit, arguments.out)


def report(text: str, seeds: Seeds, name: str, commit: str, docs: Path) -> None:
    """Write the table of a network and of the commit that the run began with into the page of results.

    Raises
    ------
    ValueError
        If the seeds are those that ratios were set on.
    """
    seeds.require_reporting()
    span = f"Seeds {seeds.values[0]} to {seeds.values[-1]}, drawn when the command ran"
    write_section(docs, "tracking", "learned", f"{span}; network {name}; commit {commit}.\n\n{text}")
