"""The scenarios on WebAssembly: the executive needs nothing but Python, so it runs in a page, too."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

from executive.runtime.scenario import parse_scenario, run_scenario
from tests.executive.test_scenarios import OWN, PUBLIC
from tests.shared import script, shared


def test_every_scenario_gives_the_same_trace_on_webassembly(tmp_path: Path) -> None:
    docs_live = script("docs_live")
    node, environment = docs_live.install_pyodide()
    archive = tmp_path / "executive.zip"
    docs_live.write_executive(archive)
    paths = [*OWN, *(shared(f"executive_scenarios/{name}.json") for name in PUBLIC)]
    documents = {path.name: json.loads(path.read_text()) for path in paths}
    (tmp_path / "scenarios.json").write_text(json.dumps(documents))
    done = subprocess.run(
        [node, "run_scenarios.mjs", str(archive), str(tmp_path / "scenarios.json")],
        cwd=docs_live.PLACE,
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    there = json.loads(done.stdout)
    here = {}
    for name, document in documents.items():
        run = run_scenario(parse_scenario(document, name))
        here[name] = {**run.to_json(), "differences": list(run.differences)}
    assert there == json.loads(json.dumps(here))
    assert not any(result["differences"] for result in there.values())
