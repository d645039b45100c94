"""Put beside the built pages what their live examples run on: the executive, and Python for WebAssembly.

    python scripts/docs_live.py site

Python comes from npm by `scripts/wasm/package-lock.json`.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import shutil
import subprocess
import zipfile
from pathlib import Path

from build_web import node_environment

ROOT = Path(__file__).resolve().parents[1]
PLACE = ROOT / "scripts" / "wasm"
PARTS = ("pyodide.mjs", "pyodide.asm.mjs", "pyodide.asm.wasm", "python_stdlib.zip", "pyodide-lock.json")


def main() -> None:
    """Write the parts into the folder of the built pages."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("site", type=Path)
    live = parser.parse_args().site / "live"
    install_pyodide()
    write_executive(live / "executive.zip")
    (live / "pyodide").mkdir(exist_ok=True)
    for part in PARTS:
        shutil.copy(PLACE / "node_modules" / "pyodide" / part, live / "pyodide")


def install_pyodide() -> tuple[str, dict[str, str]]:
    """Install what the lock names if it is not there; return Node and its environment."""
    npm, environment = node_environment(os.environ)
    lock, installed = PLACE / "package-lock.json", PLACE / "node_modules" / ".package-lock.json"
    with lock.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # npm empties the folder first: another would find it half filled
        if not installed.exists() or installed.stat().st_mtime < lock.stat().st_mtime:
            done = subprocess.run(
                [*npm, "ci"], cwd=PLACE, env=environment, capture_output=True, text=True, timeout=300
            )
            if done.returncode:
                raise SystemExit(f"npm ci in {PLACE} ended with {done.returncode}: {done.stderr[-2000:]}")
    return "node", environment


def write_executive(archive: Path) -> None:
    """Write the executive's modules, and no more, into a zip file."""
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as file:
        for path in sorted((ROOT / "executive").rglob("*.py")):
            file.write(path, path.relative_to(ROOT))


if __name__ == "__main__":
    main()
