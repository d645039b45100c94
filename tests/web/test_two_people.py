"""A scientist and a flight director on the page alone, each with a browser profile and a key of their own."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.web import two_people
from tests.web.conftest import run_server
from tests.web.page import chromium, open_page

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]
QUERY = "?quality=test&webgl=off"


def test_two_people_close_three_sols_from_an_empty_folder_on_the_page_alone(
    built_ui: Path, tmp_path: Path
) -> None:
    assert built_ui.is_dir()
    data, packages = tmp_path / "data", tmp_path / "packages"
    data.mkdir()
    packages.mkdir()
    with (
        run_server(data, demo=False, AUTH="accounts") as server,
        chromium() as browser,
        open_page(browser, server, QUERY) as scientist,
        open_page(browser, server, QUERY) as director,
    ):
        two_people.play(scientist, director, server, packages)
        assert len(list(packages.iterdir())) == two_people.SOLS
        three = [f"sol-{number}" for number in range(1, two_people.SOLS + 1)]
        assert [director.get_by_test_id(sol).count() for sol in three] == [1, 1, 1]
