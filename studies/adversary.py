"""Scripts of attackers against the uplink, and what came of them.

.venv/bin/python -m studies.adversary --scripts 3000
"""

from __future__ import annotations

import argparse
import secrets
import tempfile
from collections import Counter
from pathlib import Path

from tests.adversary.model import BAD, Script


def main() -> None:
    """Print the counts; end with 1 if an attacker got through."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scripts", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=secrets.randbelow(2**31))
    asked = parser.parse_args()
    total: Counter[str] = Counter()
    for number in range(asked.scripts):
        with tempfile.TemporaryDirectory(prefix="outcrop-adversary-") as folder:
            total += Script(Path(folder), asked.seed + number).play()
    bad = {name: total[name] for name in BAD}
    print(
        f"seeds from {asked.seed}: {total['scripts']} scripts, "
        f"{total['packages']} packages, {total['runs']} ran"
    )
    print(bad)
    raise SystemExit(1 if any(bad.values()) else 0)


if __name__ == "__main__":
    main()
