"""A map made at a site, and where it lies now."""

from __future__ import annotations

from dataclasses import dataclass

from ground.records.stored import OfMission


@dataclass(frozen=True, slots=True)
class SiteMap(OfMission):
    """A map made at a site; `outline_m` is where it lies now, `sigma_m` how well that is known (worst)."""

    name: str
    notes: str
    frame_id: str
    outline_m: list[list[float]]
    sigma_m: float
    file_name: str
    media: str
    size_bytes: int
    sha256: str
    file_url: str
