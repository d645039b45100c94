"""Execute a package on the training rover of a mission; a run that was cut off goes on."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from zipfile import BadZipFile

from ground.day.prepare import Report
from ground.durable import copy_folder, make_folder, put_in_place
from ground.errors import ArchiveError, GroundError, JobFailedError, StoreAwayError
from ground.gdr.files import files_at
from ground.gdr.places import JOB_PATIENCE_S, fetched, keep_folder, open_store, place_of
from ground.jobs.queue import WorkStoppedError
from ground.resources.executions.order import ExecutionWork
from ground.resources.runs.work import RunResult, read_run_folder
from ground.uplink.admission import bind
from ground.uplink.execute import Place, execute_package
from ground.uplink.flight import Sample
from ground.uplink.ledger import Ledger
from ground.uplink.training import TRUST_FILE, TrainedSigner, training_trust, unfit

RUNS = "runs"


class ExecutionResult(RunResult):
    """What a run's row holds of an execution, and its id."""

    run: str


def work(order: ExecutionWork, report: Report, should_stop: Callable[[], bool]) -> ExecutionResult:
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
    people = [TrainedSigner(s.person, s.public, s.roles) for s in order.signers]
    budget_s = max(float(order.problem["budget"]["time_s"]), 1.0)

    def tell(sample: Sample) -> None:
        if should_stop():
            raise WorkStoppedError
        report(min(0.97, sample.t_s / budget_s), f"t = {sample.t_s:.0f} s")

    def prepare(ledger: Ledger) -> None:
        _write_world(home, order)
        bind(ledger, training_trust(home, order.mission, people), home)

    report(0.0, "the rover checks the package")
    try:
        require_simulated(order.rover)
        package = fetched(order.package_path)
        make_folder(home)
        out = home / RUNS / f"{order.counter}"
        if not (out / "run.json").exists():  # else only the last step is left
            execute_package(
                package,
                Place(order.rover, home, home / TRUST_FILE, order.seed, training=True),
                out,
                resume=(out / "journal.jsonl").exists(),
                on_sample=tell,
                prepare=prepare,
            )
        report(0.98, "products")
        kept = open_store(order.run_dir, JOB_PATIENCE_S)
        if not kept.root.exists():
            copy_folder(out, kept.root)
        keep_folder(kept)
        return {**read_run_folder(out, files_at(order.files_dir)), "run": order.run_id}
    except StoreAwayError:
        raise  # the job waits, what the rover did is kept with it
    except ArchiveError as err:
        raise JobFailedError(f"{err}{_left_out(people, place_of(order.package_path))}") from err
    except (GroundError, RoverError, ExecutiveError, CrlError) as err:
        raise JobFailedError(str(err)) from err
    except OSError as err:
        raise JobFailedError(f"{err.filename or home}: {err.strerror or err}") from err


def _left_out(people: Sequence[TrainedSigner], package: Path) -> str:
    """Return who signed a package that was refused and could not be entered in the trust file."""
    try:
        odd = unfit(people, package.read_bytes())
    except (OSError, ValueError, KeyError, BadZipFile):
        return ""  # the package itself is damaged, and was refused for that
    if not odd:
        return ""
    names = ", ".join(repr(name) for name in odd)
    return (
        f"; what {names} signed does not count, as a trust file takes names of at most 80 letters, digits, "
        "spaces and _.'- alone, which begin with a letter or digit"
    )


def _write_world(home: Path, order: ExecutionWork) -> None:
    document = {
        "format": "world/1",
        "name": str(order.problem.get("name", "")),
        "profile": order.rover_profile,
        "problem": order.problem,
        "sun": asdict(order.sky),
        "terrain": str(fetched(order.terrain_dir).resolve()),
    }
    draft = home / "world.json.draft"
    draft.write_text(json.dumps(document) + "\n", encoding="utf-8")
    put_in_place(draft, home / "world.json")
