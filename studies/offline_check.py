"""Processor time of checking a package offline: trust file, signatures, digests, expiry.

    .venv/bin/python -m studies.offline_check --packages 200

Each package has a plan of its own; what is measured begins with the bytes of both files.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from ground.uplink.training import make_team
from ground.uplink.verify import read_trust, verify_package
from tests.ground.signed import signed_package

LIMIT_MS = 50.0
TASK = "(task :id t{n} :action wait :parameters (duration_s = {n}))"


def main() -> None:
    """Print median and 99th percentile; end with 1 if the limit is passed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--packages", type=int, default=200)
    parser.add_argument("--tasks", type=int, default=100, help="tasks of the largest plan")
    asked = parser.parse_args()
    spent = []
    with tempfile.TemporaryDirectory() as folder:
        team = make_team(Path(folder) / "keys", training=False)
        trust = team.trust.read_bytes()
        for number in range(1, asked.packages + 1):
            tasks = " ".join(TASK.format(n=n) for n in range(1, 2 + number * asked.tasks // asked.packages))
            plan = f"(plan :id p :node (block :id all :node-list ({tasks})))"
            content = signed_package(team, number, plan)
            begin = time.process_time()
            verify_package(content, read_trust(trust), datetime.now(UTC))
            spent.append(1000 * (time.process_time() - begin))
    median, high = np.percentile(spent, [50, 99])
    print(f"{asked.packages} packages: median {median:.2f} ms of CPU, 99th percentile {high:.2f} ms")
    raise SystemExit(1 if high > LIMIT_MS else 0)


if __name__ == "__main__":
    main()
