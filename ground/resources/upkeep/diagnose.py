"""Find what is wrong with a service, and say what to do about each."""

from __future__ import annotations

import shutil
import stat
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address

from sqlalchemy import func, select
from sqlalchemy.exc import SQLAlchemyError

from ground.gdr.migrate import current_revision, newest_revision
from ground.gdr.repository import Repository
from ground.jobs.executors import knock
from ground.jobs.row import JobRow
from ground.records.actor import Role
from ground.resources.backups.check_files import check_files
from ground.resources.people.row import PersonRow
from ground.resources.terrains.row import TerrainRow
from ground.resources.upkeep.noted import Act, noted
from ground.settings import Authentication, ExecutorKind

LEAST_FREE_BYTES = 2_000_000_000
"""A plan's run folders, a backup's draft and a campaign of ten thousand days fit into it together."""
WAITS = timedelta(minutes=10)
"""A job that waits longer than this while none runs has no worker."""
TOO_LONG_AGO = timedelta(days=7)
LATELY = timedelta(days=1)


@dataclass(frozen=True, slots=True)
class Finding:
    """Something wrong, and what to do."""

    what: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.what}: {self.remedy}"


def diagnose(repo: Repository) -> list[Finding]:
    """Return what is wrong with the service of these settings; nothing is changed."""
    store = list(_objects(repo))
    found = [*_folder(repo), *_door(repo), *store]
    try:
        database = list(_schema(repo))
    except SQLAlchemyError as err:
        where = repo.database.url.render_as_string(hide_password=True)
        reason = str(err.__cause__ or err).splitlines()[0]
        database = [
            Finding(f"the database {where} does not answer ({reason})", "start it, or mend the address")
        ]
    found += database
    if not database:
        for look in LOOKS:
            if not (store and look is _files):
                found += look(repo)
    return found


def _folder(repo: Repository) -> Iterator[Finding]:
    folder = repo.data_dir
    if folder.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        yield Finding(f"others of this machine can look into {folder}", f"chmod 700 {folder}")
    free = shutil.disk_usage(folder).free
    if free < LEAST_FREE_BYTES:
        yield Finding(
            f"{free / 1e9:.1f} GB are free on the disk of {folder}, {LEAST_FREE_BYTES / 1e9:g} are needed",
            "free some, or remove old runs with `outcrop prune`",
        )


def _objects(repo: Repository) -> Iterator[Finding]:
    if trouble := repo.files.store.trouble():
        yield Finding(trouble, "start it or mend OUTCROP_OBJECTS; files wait until then, none is lost")


def _door(repo: Repository) -> Iterator[Finding]:
    settings = repo.settings
    try:
        beyond = not ip_address(settings.host).is_loopback
    except ValueError:
        beyond = settings.host != "localhost"
    if beyond and settings.auth is Authentication.ACCOUNTS and not settings.cookie_secure:
        yield Finding(
            f"the server listens on {settings.host}, and its cookies also go over plain http",
            "put a TLS proxy before it and set OUTCROP_COOKIE_SECURE=true",
        )
    if settings.executor is ExecutorKind.DISTRIBUTED:
        try:
            knock(settings.dask_scheduler)
        except OSError as err:
            yield Finding(str(err), "start it; jobs wait until then")


def _schema(repo: Repository) -> Iterator[Finding]:
    found, needed = current_revision(repo.database), newest_revision()
    if found == needed:
        return
    if found is not None and found > needed:
        yield Finding(
            f"the database is at revision {found}, newer than this program's {needed}",
            "install the newer version",
        )
    else:
        yield Finding(
            f"the database is at revision {found or 'none'}, {needed} is needed", "run `outcrop migrate`"
        )


def _jobs(repo: Repository) -> Iterator[Finding]:
    now = datetime.now(UTC)
    with repo.database.read() as session:
        oldest = session.scalar(select(func.min(JobRow.created_utc)).where(JobRow.state == "queued"))
        running = (
            session.scalar(select(func.count()).select_from(JobRow).where(JobRow.state == "running")) or 0
        )
        stuck = list(
            session.scalars(
                select(JobRow.id).where(JobRow.state == "running", JobRow.lease_until_utc < now - WAITS)
            )
        )
        failed = session.scalars(
            select(JobRow)
            .where(JobRow.state == "failed", JobRow.finished_utc > now - LATELY)
            .order_by(JobRow.finished_utc.desc())
        ).all()
        last = failed[0].message if failed else ""
    if oldest is not None and not running and now - oldest > WAITS:
        waits = (now - oldest).total_seconds() / 60
        yield Finding(
            f"a job has waited {waits:.0f} min and none runs",
            "start `outcrop worker`, or set OUTCROP_SERVE_WORKER=true",
        )
    if stuck:
        yield Finding(
            f"{len(stuck)} jobs, such as {stuck[0]}, lost their worker and nobody took them over",
            "start `outcrop worker`; it takes them up again",
        )
    if failed:
        yield Finding(
            f"{len(failed)} jobs failed in the last day, the last with: {last}",
            "`outcrop job list` shows them",
        )


def _people(repo: Repository) -> Iterator[Finding]:
    if repo.settings.auth is not Authentication.ACCOUNTS:
        return
    with repo.database.read() as session:
        able = select(PersonRow.id).where(PersonRow.active, PersonRow.role == Role.ADMIN.value)
        if session.scalars(able.limit(1)).first() is None:
            yield Finding("nobody is an administrator", "`outcrop person add NAME --role admin --password`")


def _files(repo: Repository) -> Iterator[Finding]:
    report = check_files(repo)
    if report.without_file:
        yield Finding(
            f"{len(report.without_file)} records, such as {report.without_file[0]}, lack their file",
            "restore them from a backup; `outcrop check` names all",
        )
    stray = len(report.unnamed) + len(report.strays)
    if stray:
        yield Finding(
            f"{stray} files and folders belong to no record", "`outcrop check --sweep` removes them"
        )
    with repo.database.read() as session:
        terrains = [identifier for (identifier,) in session.execute(select(TerrainRow.id))]
    there = set(repo.folders("terrains").names())
    for identifier in terrains:
        if identifier not in there:
            yield Finding(f"the folder of terrain {identifier} is gone", "restore it from a backup")


def _habits(repo: Repository) -> Iterator[Finding]:
    acts: dict[Act, tuple[str, str]] = {
        "backup": ("backup", "`outcrop backup FILE`"),
        "audit": ("check of the history", "`outcrop audit verify`"),
        "contents": ("check of the files' contents", "`outcrop check --contents`"),
    }
    for act, (name, remedy) in acts.items():
        last = noted(repo, act)
        if last is None:
            yield Finding(f"there was no {name} yet", remedy)
            continue
        when, faults = last
        if faults:
            yield Finding(f"the last {name} found {faults} faults", f"{remedy} names them")
        elif datetime.now(UTC) - when > TOO_LONG_AGO:
            yield Finding(f"the last {name} was on {when:%Y-%m-%d}", remedy)


LOOKS: tuple[Callable[[Repository], Iterator[Finding]], ...] = (_jobs, _people, _files, _habits)
