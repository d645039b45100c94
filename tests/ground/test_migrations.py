"""The schema of the migrations is the schema of the models, up and down, with rows in it."""

from __future__ import annotations

from pathlib import Path

import pytest
from alembic.autogenerate import compare_metadata
from alembic.runtime.migration import MigrationContext
from sqlalchemy import inspect, select

from ground.gdr.database import Database
from ground.gdr.history import verify_chains
from ground.gdr.migrate import current_revision, migrate, migrations_dir, newest_revision
from ground.gdr.repository import Repository
from ground.resources.keep_outs.bodies import KeepOutCreate
from ground.resources.keep_outs.create_keep_out import create_keep_out
from ground.resources.keep_outs.row import KeepOutRow
from ground.resources.missions.row import MissionRow
from ground.resources.missions.value import Mission
from ground.resources.tables import METADATA
from ground.resources.targets.bodies import TargetCreate
from ground.resources.targets.create_target import create_target
from ground.resources.targets.row import TargetRow
from tests.ground.conftest import PLANNER


def test_migrations_from_empty_give_exactly_the_schema_of_the_models(repo: Repository) -> None:
    with repo.database.engine.connect() as connection:
        context = MigrationContext.configure(connection, opts={"compare_type": True})
        assert compare_metadata(context, METADATA) == []


def test_migrations_go_down_with_rows_and_up_again(repo: Repository, mission: Mission) -> None:
    assert current_revision(repo.database) == newest_revision()
    migrate(repo.database, "base", down=True)
    assert set(inspect(repo.database.engine).get_table_names()) <= {"alembic_version"}
    migrate(repo.database)
    with repo.database.read() as session:
        assert session.scalars(select(MissionRow)).all() == []
        assert verify_chains(session) == (0, [])


def test_a_step_back_and_forth_keeps_what_was_there_before(repo: Repository, mission: Mission) -> None:
    create_target(repo, PLANNER, mission.id, TargetCreate(east_m=4.0, north_m=1.0))
    create_keep_out(repo, PLANNER, mission.id, KeepOutCreate(polygon_m=[(1, 1), (2, 1), (2, 2)]))
    migrate(repo.database, "0001", down=True)
    assert "frames" not in inspect(repo.database.engine).get_table_names()
    migrate(repo.database)
    with repo.database.read() as session:
        assert [len(session.scalars(select(row)).all()) for row in (MissionRow, TargetRow, KeepOutRow)] == [
            1,
            1,
            1,
        ]
        assert verify_chains(session)[1] == []


def test_a_second_migration_changes_nothing(repo: Repository) -> None:
    assert migrate(repo.database) == (newest_revision(), newest_revision())


def test_each_migration_stands_alone() -> None:
    for path in (migrations_dir() / "versions").glob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert "ground" not in [
            line.split()[1].split(".")[0]
            for line in text.splitlines()
            if line.startswith(("import ", "from "))
        ]


def test_an_unknown_database_address_is_refused(tmp_path: Path) -> None:
    from ground.settings import SettingsError, load_settings

    with pytest.raises(SettingsError, match=r"OUTCROP_DATABASE_URL='mysql:.*use sqlite"):
        load_settings(data_dir=tmp_path, database_url="mysql://x")
    Database(f"sqlite:///{tmp_path / 'deep' / 'er' / 'x.db'}").ping()
