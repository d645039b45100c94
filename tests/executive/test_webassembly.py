"""The scenarios on WebAssembly: the executive needs nothing but Python, so it runs in a page, too."""

from __future__ import annotations

import importlib.util
import json
import os
import subprocess
import zipfile
from pathlib import Path
from types import ModuleType

from executive.runtime.scenario import parse_scenario, run_scenario
from tests.executive.test_scenarios import OWN, PUBLIC
from tests.shared import shared

ROOT = Path(__file__).parents[2]
PLACE = Path(__file__).parent / "wasm"


def build_web() -> ModuleType:
    """Return the script that knows the project's Node."""
    spec = importlib.util.spec_from_file_location("build_web", ROOT / "scripts" / "build_web.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def installed_node() -> tuple[str, dict[str, str]]:
    """Return Node and its environment; what `package-lock.json` names is installed beside the script."""
    npm, environment = build_web().node_environment(os.environ)
    lock, installed = PLACE / "package-lock.json", PLACE / "node_modules" / ".package-lock.json"
    if not installed.exists() or installed.stat().st_mtime < lock.stat().st_mtime:
        done = subprocess.run(
            [*npm, "ci"], cwd=PLACE, env=environment, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0, done.stderr[-2000:]
    return "node", environment


def test_every_scenario_gives_the_same_trace_on_webassembly(tmp_path: Path) -> None:
    node, environment = installed_node()
    archive = tmp_path / "executive.zip"
    with zipfile.ZipFile(archive, "w") as file:
        for path in sorted((ROOT / "executive").rglob("*.py")):
            file.write(path, path.relative_to(ROOT))
    paths = [*OWN, *(shared(f"executive_scenarios/{name}.json") for name in PUBLIC)]
    documents = {path.name: json.loads(path.read_text()) for path in paths}
    (tmp_path / "scenarios.json").write_text(json.dumps(documents))
    done = subprocess.run(
        [node, "run.mjs", str(archive), str(tmp_path / "scenarios.json")],
        cwd=PLACE,
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
