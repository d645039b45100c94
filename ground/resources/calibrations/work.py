"""Learn the parameters of a path network from recorded runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ground.day.prepare import Report
from ground.errors import ArchiveError, InvalidInputError, JobFailedError
from ground.gdr.places import fetched, place_of
from ground.gdr.terrain_folders import load_cached
from ground.jobs.queue import WorkStoppedError
from ground.resources.calibrations.driven_legs import DrivenLeg, calibrate, legs_of_run
from ground.resources.calibrations.made_activities import MadeActivity, activities_of_run
from ground.resources.calibrations.order import CalibrationOrder

READING = 0.3
"""Share of the work that reading the runs is."""


def work(order: CalibrationOrder, report: Report, should_stop: Callable[[], bool]) -> Mapping[str, object]:
    """Return `calibration`, the document of the calibration that run folders bear out.

    Raises
    ------
    JobFailedError
        If a run that was asked for holds no legs, or there are too few of them.
    WorkStoppedError
        If it was asked to stop.
    """
    try:
        return {"calibration": learn(order, report, should_stop)}
    except InvalidInputError as err:
        raise JobFailedError(err.message) from err


def learn(order: CalibrationOrder, report: Report, should_stop: Callable[[], bool]) -> Mapping[str, object]:
    """Return the document; see above, but wrong runs are an `InvalidInputError`."""
    from planner.path_network import calibration_document
    from rover_iface.profile import load_profile

    def tell(share: float, what: str) -> None:
        if should_stop():
            raise WorkStoppedError
        report(share, what)

    profile = load_profile(order.rover_profile)
    legs: list[DrivenLeg] = []
    made: list[MadeActivity] = []
    used = 0
    for index, address in enumerate(order.folders):
        tell(READING * index / len(order.folders), f"legs of {place_of(address).name}")
        folder = fetched(address)
        try:
            found = legs_of_run(folder)
        except ArchiveError as err:
            if order.strict:
                raise InvalidInputError(err.message, pointer="/run_ids") from err
            continue
        legs += found
        made += activities_of_run(folder, profile)
        used += bool(found)
    tell(READING, "terrain")
    runs = f"{used} recorded run{'' if used == 1 else 's'}"
    fitted = calibrate(
        legs,
        profile,
        load_cached(fetched(order.terrain_dir)),
        name=order.name,
        source=f"{len(legs)} legs of {runs} of rover profile {profile.name} {profile.version}",
        made=made,
        report=lambda share: tell(READING + (1.0 - READING) * share, "metres in and out of view"),
    )
    return calibration_document(fitted)
