"""Execute a package on the training rover of a mission; a run that was cut off goes on."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from ground.day.prepare import Report
from ground.errors import GroundError, JobFailedError
from ground.gdr.durable import copy_folder, make_folder
from ground.jobs.queue import WorkStoppedError
from ground.resources.executions.order import ExecutionWork
from ground.resources.runs.work import read_run_folder
from ground.uplink.admission import commission
from ground.uplink.execute import Place, execute_package
from ground.uplink.flight import Sample
from ground.uplink.training import TrainedSigner, training_trust
from mission.codec import Document

RUNS = "runs"


def work(order: ExecutionWork, report: Report, should_stop: Callable[[], bool]) -> Document:
    """Return outcome, trace, telemetry and products of an execution; the files of products are in the store.

    Raises
    ------
    JobFailedError
        If the rover refuses the package, or cannot fly it.
    """
    from executive.crl import CrlError
    from executive.errors import ExecutiveError
    from rover_iface.errors import RoverError
    from rover_iface.registry import require_simulated

    home = Path(order.rover_dir)
    budget_s = max(float(order.problem["budget"]["time_s"]), 1.0)

    def tell(sample: Sample) -> None:
        if should_stop():
            raise WorkStoppedError
        report(min(0.97, sample.t_s / budget_s), f"t = {sample.t_s:.0f} s")

    report(0.0, "the rover checks the package")
    try:
        require_simulated(order.rover)
        make_folder(home)
        _write_world(home, order)
        people = [TrainedSigner(s.person, s.public, s.roles) for s in order.signers]
        trust = training_trust(home, order.mission, people)
        commission(home, trust)
        out = home / RUNS / f"{order.counter}"
        if not (out / "run.json").exists():  # else only the last step is left
            execute_package(
                Path(order.package_path),
                Place(order.rover, home, trust, order.seed),
                out,
                resume=(out / "journal.jsonl").exists(),
                on_sample=tell,
            )
    except (GroundError, RoverError, ExecutiveError, CrlError) as err:
        raise JobFailedError(str(err)) from err
    report(0.98, "products")
    if not Path(order.run_dir).exists():
        copy_folder(out, Path(order.run_dir))
    return {**read_run_folder(out, Path(order.files_dir)), "run": order.run_id}


def _write_world(home: Path, order: ExecutionWork) -> None:
    document = {
        "format": "world/1",
        "name": str(order.problem.get("name", "")),
        "profile": order.rover_profile,
        "problem": order.problem,
        "sun": asdict(order.sky),
        "terrain": str(Path(order.terrain_dir).resolve()),
    }
    draft = home / "world.json.draft"
    draft.write_text(json.dumps(document) + "\n", encoding="utf-8")
    draft.replace(home / "world.json")
