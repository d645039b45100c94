"""Seeds of tests that draw: fresh on a desk, the same each time where a change is judged."""

from __future__ import annotations

import os
import secrets

JUDGED = os.environ.get("CI") == "true"
"""What fails of a rare draw there was not broken by the change; studies search with fresh seeds."""


def drawn_seed() -> int:
    """Return a seed and print it."""
    seed = 20261123 if JUDGED else secrets.randbelow(2**31)
    print(f"seed {seed}")
    return seed
