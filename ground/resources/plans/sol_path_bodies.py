"""What the API takes and answers for sol paths."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from ground.errors import InvalidInputError
from ground.records.forms import Body, Id, LongName, Seed, Text
from mission.errors import MissionError
from mission.sol_timeline import MAX_SOLS, SOL_SERIES, SolSeries

Watts = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e5)]
Charge = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=1e10)]
Lasting = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=1e6)]
Sols = Annotated[int, Field(strict=True, ge=1, le=MAX_SOLS)]
WHOLE_DAYS = 5.0e5
"""Latest time of a window, seconds: some days."""
WithinDays = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=WHOLE_DAYS)]


class BatteryBody(Body):
    """What the battery holds at most, in the first morning, and at least at any instant."""

    capacity_j: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=1e10)]
    charge_j: Charge
    floor_j: Charge = 0.0


class PowerSegmentBody(Body):
    """A time of constant power: what the sun gives, and what sleep and heaters take."""

    duration_s: Lasting
    solar_w: Watts = 0.0
    sleep_w: Watts = 0.0
    heater_w: Watts = 0.0


class SolTimelineBody(Body):
    """One sol: the time of its work, and the power from the end of that to the next morning."""

    time_s: Lasting
    rest: Annotated[list[PowerSegmentBody], Field(max_length=100, default_factory=list)]


class SolWindowBody(Body):
    """A request may be carried out on this sol, at any time or within a window of its plan clock."""

    observation: Id
    sol: Sols
    window_s: tuple[WithinDays, WithinDays] | None = None


class PowerBody(Body):
    """Battery, times and power of the sols (`sol-series/1`); the last sol is repeated as often as needed."""

    battery: BatteryBody
    sols: Annotated[list[SolTimelineBody], Field(min_length=1, max_length=MAX_SOLS)]
    windows: Annotated[list[SolWindowBody], Field(max_length=5000, default_factory=list)]

    def series(self, sols: int) -> SolSeries:
        """Return the series with so many sols.

        Raises
        ------
        InvalidInputError
            If the battery or a window contradicts itself.
        """
        try:
            document = {"format": SOL_SERIES.format, **self.model_dump(mode="json")}
            return SOL_SERIES.from_document(document, "power").repeated(sols)
        except MissionError as err:
            raise InvalidInputError(str(err), pointer="/power") from err


POWER = {
    "battery": {"capacity_j": 2_400_000.0, "charge_j": 2_000_000.0, "floor_j": 300_000.0},
    "sols": [
        {
            "time_s": 14_400.0,
            "rest": [
                {"duration_s": 18_000.0, "solar_w": 70.0},
                {"duration_s": 56_000.0, "sleep_w": 5.0, "heater_w": 3.0},
            ],
        }
    ],
    "windows": [],
}


class SolPathCreate(Body):
    """Ask for a plan of the first of several sols that share battery and requests.

    `request_ids` limits it to some requests; empty = all that are open. Without `power` each sol has the
    mission's budgets anew.
    """

    sols: Sols
    power: Annotated[PowerBody | None, Field(examples=[POWER])] = None
    name: LongName | None = None
    notes: Text = ""
    sol_id: Id | None = None
    max_branches: Annotated[int, Field(strict=True, ge=0, le=64)] = 6
    time_limit_s: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0, le=3600.0)] = 60.0
    seed: Seed = 1
    request_ids: Annotated[list[Id], Field(max_length=5000, default_factory=list)]


class OutlinedSolDocument(BaseModel):
    """What the policy does on one sol, in the mean of drawn futures.

    `observations` are the requests that it carries out there likelier than not; `charge_j` is that of the
    morning, `drawn_j` what the work draws, `overrun` the chance that it ends over a budget.
    """

    sol: int
    observations: list[str]
    utility: float
    charge_j: float
    drawn_j: float
    overrun: float


class SolPathDocument(BaseModel):
    """What all sols of a path are worth (`sol-path/1`); the plan itself is for the first one.

    `mean` is what the policy earned over all sols in 20,000 drawn futures, `lower` that less its 99 % error;
    no policy whatever earns more than `upper`.
    """

    model_config = ConfigDict(extra="allow")
    format: str
    mean: float
    standard_error: float
    lower: float
    upper: float
    order: list[str]
    sols: list[OutlinedSolDocument]
    stopped: bool
