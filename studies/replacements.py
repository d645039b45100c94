"""Random replacements at random moments of random plans, beside an interpreter written from CRL.md alone.

    .venv/bin/python -m studies.replacements --replacements 100000 --minutes 10 [--out docs]

Each case is a random plan in a random world that is replaced up to four times, half of the cases by edits
that move nodes under other options. After every macro step the invariants of CRL.md 7.4 are looked at (one
root in force, no composite over before its children, no command without a node that waits for its answer,
resources within their capacity); the journal has to replay, and the trace has to equal the interpreter's.
"""

from __future__ import annotations

import argparse
import secrets
import time
from collections import Counter
from pathlib import Path

from tests.executive.replaced_runs import check_seed
from tests.executive.replacements import EDITS, OPTION_EDITS


def study(wanted: int, minutes: float, first: int) -> tuple[Counter[str], list[tuple[int, str]], int]:
    """Return the counts, the failures as seed and reason, and the seed after the last one."""
    counts: Counter[str] = Counter()
    failures: list[tuple[int, str]] = []
    begin, seed = time.monotonic(), first
    while counts["replacements"] < wanted and time.monotonic() - begin < 60 * minutes:
        edits = EDITS if seed % 2 else OPTION_EDITS
        counts["cases"] += 1
        try:
            asked = check_seed(seed, edits)
            counts["replacements"] += asked
            counts["valid"] += asked > 0
        except Exception as error:  # noqa: BLE001 - whatever goes wrong in a case is what the study is for
            failures.append((seed, f"{type(error).__name__}: {str(error)[:200]}"))
        seed += 1
    return counts, failures, seed


def main() -> None:
    """Draw cases from a fresh seed, or a given one, and print what came of them."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--replacements", type=int, default=100_000)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--seed", type=int, help="first seed; fresh if none is given")
    parser.add_argument("--out", type=Path, help="docs folder: the result goes into results/live.md")
    options = parser.parse_args()
    first = options.seed if options.seed is not None else secrets.randbelow(2**31)
    counts, failures, after = study(options.replacements, options.minutes, first)
    print(
        f"seeds {first} to {after - 1}: {counts['replacements']} replacements in {counts['valid']} runs "
        f"({counts['cases'] - counts['valid'] - len(failures)} drawn plans are not valid ones), "
        f"{len(failures)} failures"
    )
    lines = [
        f"| replacements, runs | {counts['replacements']}, {counts['valid']} "
        f"(seeds {first} to {after - 1}) |",
        f"| runs that broke a rule or differed from the model | {len(failures)} |",
    ]
    for seed, reason in failures[:20]:
        print(f"  seed {seed}: {reason}")
    if options.out is not None:
        from studies.live_kills import put

        put(
            options.out / "results" / "live.md",
            "replacements",
            f"python -m studies.replacements --replacements {options.replacements} --seed {first}",
            lines,
        )
    raise SystemExit(1 if failures else 0)


if __name__ == "__main__":
    main()
