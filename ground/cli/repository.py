"""How commands come to the repository; errors end with one line."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ground.cli.failure import fail, refusals

if TYPE_CHECKING:
    from ground.gdr.repository import Repository
    from ground.records.actor import Actor
    from ground.settings import Settings


def settings_or_fail() -> Settings:
    """Return the settings, or end with the name of the wrong one."""
    from ground.settings import SettingsError, load_settings

    try:
        return load_settings()
    except SettingsError as err:
        fail(str(err))


def require_migrated(settings: Settings) -> None:
    """End with one line unless the database answers and has this version's schema."""
    from sqlalchemy.exc import SQLAlchemyError

    from ground.gdr.migrate import current_revision, newest_revision
    from ground.gdr.repository import open_repository

    repo = open_repository(settings)
    try:
        found = current_revision(repo.database)
    except SQLAlchemyError as err:
        where = repo.database.url.render_as_string(hide_password=True)
        fail(f"cannot reach the database {where}: {str(err.__cause__ or err).splitlines()[0]}")
    finally:
        repo.database.dispose()
    if found is not None and found > newest_revision():
        fail(
            f"the database is at revision {found}, newer than this program's {newest_revision()}: install "
            "the newer version"
        )
    if found != newest_revision():
        fail(
            f"the database is at revision {found or 'none'}, {newest_revision()} is needed: run "
            "`outcrop migrate`"
        )


def make_if_empty(settings: Settings) -> bool:
    """Give an empty database the schema of this version; return whether it was empty.

    One that holds anything is left alone: what is older is brought forward by who runs `outcrop migrate`.
    """
    from sqlalchemy import inspect
    from sqlalchemy.exc import SQLAlchemyError

    from ground.gdr.migrate import migrate
    from ground.gdr.repository import open_repository

    repo = open_repository(settings)
    try:
        if inspect(repo.database.engine).get_table_names():
            return False
        migrate(repo.database)
        return True
    except SQLAlchemyError as err:
        where = repo.database.url.render_as_string(hide_password=True)
        fail(f"cannot make the database {where}: {str(err.__cause__ or err).splitlines()[0]}")
    finally:
        repo.database.dispose()


def open_or_fail() -> Repository:
    """Return the repository, migrated, or end with one line."""
    from ground.gdr.repository import open_repository

    settings = settings_or_fail()
    require_migrated(settings)
    return open_repository(settings)


def actor_or_fail(repo: Repository, name: str) -> Actor:
    """Return a person by name, or end with one line that lists who there is."""
    from sqlalchemy import select

    from ground.resources.people.accounts import actor_of
    from ground.resources.people.row import PersonRow

    with refusals():
        with repo.database.read() as session:
            people = list(session.scalars(select(PersonRow).where(PersonRow.active).order_by(PersonRow.id)))
        for person in people:
            if person.name == name:
                return actor_of(person)
    return fail(f"there is nobody called {name!r}; there are {', '.join(p.name for p in people) or 'none'}")
