"""What the API takes for executions."""

from __future__ import annotations

from ground.records.forms import Body, Name, Seed


class ExecutionCreate(Body):
    """Execute the package of an uplinked plan on the mission's training rover, a simulated one.

    It checks the package as any rover does: signatures, digests, expiry and counter, and begins it once.
    """

    rover: Name = "abstract"
    seed: Seed = 1
