"""Instruments as data: how one is used, and what its use costs."""

from __future__ import annotations

from enum import StrEnum

from mission.errors import MissionError
from mission.values import Chance, NotNegative, value


class Use(StrEnum):
    """How an instrument is used: placed on the target by the arm, or from where the rover stands."""

    CONTACT = "contact"
    REMOTE = "remote"


USUAL_ACTIONS = {Use.CONTACT: "ipplaceinstrument", Use.REMOTE: "image"}
"""Action that uses an instrument which names none."""


@value
class Amount:
    """A random amount that is not negative, by mean and standard deviation; `sd` 0 is a constant."""

    mean: NotNegative
    sd: NotNegative = 0.0

    def __post_init__(self) -> None:
        if self.mean == 0.0 and self.sd > 0.0:
            raise MissionError(f"an amount of mean 0 has the deviation {self.sd:g}; it allows only 0")


@value
class Instrument:
    """One instrument of a rover.

    Parameters
    ----------
    use
        Contact instruments are placed on a tracked target; remote ones look from a distance.
    time_s, energy_j
        Of one observation, without the hotel load.
    doc
        What it is, for people.
    camera
        Camera of the rover's rig that it looks through; empty for none.
    volume_mb
        Data of one observation, megabytes of 10^6 bytes.
    standoff_m
        Least distance from the target at which a remote instrument is used.
    p_success
        Chance that an observation carried out is worth its value.
    needs_tracking
        Whether a remote observation needs its target tracked.
    field_of_view_rad
        Full angle of view; 0 where it does not matter.
    alias
        Name under which requests hold it, where that is another than the profile's; both are understood.
    action
        Action of the rover's dictionary that uses it; empty for the usual one of its use.
    """

    use: Use
    time_s: Amount
    energy_j: Amount
    doc: str = ""
    camera: str = ""
    volume_mb: NotNegative = 0.0
    standoff_m: NotNegative = 0.0
    p_success: Chance = 1.0
    needs_tracking: bool = False
    field_of_view_rad: NotNegative = 0.0
    alias: str = ""
    action: str = ""

    @property
    def contact(self) -> bool:
        """Whether the arm places it on the target."""
        return self.use is Use.CONTACT

    @property
    def used_by(self) -> str:
        """Name of the action that uses it."""
        return self.action or USUAL_ACTIONS[self.use]

    @property
    def tracks(self) -> bool:
        """Whether its observations need their target tracked."""
        return self.needs_tracking or self.contact

    @property
    def data_mbit(self) -> float:
        """Data of one observation, megabits."""
        return self.volume_mb * 8.0
