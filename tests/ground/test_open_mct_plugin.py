"""The plug-in for Open MCT is served as it is, by a service without a built page too."""

from __future__ import annotations

from ground.app.pages import OPEN_MCT
from tests.ground.conftest import Api


def test_the_plug_in_is_a_script_at_its_own_address(sqlite_api: Api) -> None:
    answer = sqlite_api("GET", "/openmct/outcrop.js", raw=True)
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/javascript")
    assert answer.headers["cross-origin-resource-policy"] == "same-origin"
    assert answer.content == OPEN_MCT.read_bytes()
    assert b"OutcropPlugin" in answer.content
