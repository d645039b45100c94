"""What came of a file of targets and keep-outs."""

from __future__ import annotations

from dataclasses import dataclass

from ground.resources.keep_outs.value import KeepOut
from ground.resources.targets.value import Target


@dataclass(frozen=True, slots=True)
class ImportedGeometry:
    """What came of a file of targets and keep-outs."""

    targets: list[Target]
    keep_outs: list[KeepOut]
