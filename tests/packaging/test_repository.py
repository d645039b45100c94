"""What the repository as a whole promises: rooms, locks, compose file, start-up."""

from __future__ import annotations

import importlib
import pkgutil
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import grimp
import pytest
import yaml
from hatchling.builders.wheel import WheelBuilder

from studies.common.pages import write_section

ROOT = Path(__file__).resolve().parents[2]
TRACKED = subprocess.run(
    ["git", "ls-files"], cwd=ROOT, check=True, capture_output=True, text=True
).stdout.splitlines()


def test_executive_imports_the_standard_library_only() -> None:
    graph = grimp.build_graph("executive", include_external_packages=True)
    outside = {
        imported
        for module in graph.modules
        if module.split(".")[0] == "executive"
        for imported in graph.find_modules_directly_imported_by(module)
        if imported.split(".")[0] != "executive" and imported.split(".")[0] not in sys.stdlib_module_names
    }
    assert outside == set()


@pytest.mark.parametrize(
    "name", [n for n in TRACKED if n.startswith("requirements/") or n.endswith("package-lock.json")]
)
def test_lock_files_hold_no_address(name: str) -> None:
    text = (ROOT / name).read_text()
    if name.endswith(".json"):
        assert '"resolved"' not in text
    else:
        assert "://" not in text
        assert "--index" not in text
        assert "--find-links" not in text


def test_lock_files_hash_every_package() -> None:
    for lock in (ROOT / "requirements").glob("*.lock"):
        entries = re.split(r"\n(?=\S)", lock.read_text().strip())
        assert len(entries) > 30
        without = [e.split()[0] for e in entries if "--hash=sha256:" not in e]
        assert without == [], lock.name


def test_npm_does_not_write_addresses_into_its_lock() -> None:
    assert "omit-lockfile-registry-resolved=true" in (ROOT / "web/.npmrc").read_text().split()


def test_no_tracked_file_names_a_package_registry() -> None:
    hosts = re.compile(
        "|".join(["pypi" + r"\.org", "python" + "hosted", "npmjs" + r"\.(org|com)", "registry" + r"\.npm"])
    )
    found = [
        name
        for name in TRACKED
        if (ROOT / name).is_file()
        and (ROOT / name).suffix not in {".png", ".jpg", ".tif", ".glb", ".gz", ".npz", ".md"}
        and hosts.search((ROOT / name).read_text(errors="ignore"))
    ]
    assert found == []


def test_no_tracked_file_is_large() -> None:
    large = {
        n: (ROOT / n).stat().st_size
        for n in TRACKED
        if (ROOT / n).is_file() and (ROOT / n).stat().st_size > 2**21
    }
    assert large == {}


def test_compose_file_fits_the_compose_schema() -> None:
    check = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", "vendor.compose-spec"]
    done = subprocess.run(
        [*check, "docker-compose.yml"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_compose_file_runs_api_worker_and_postgresql() -> None:
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    assert set(services) == {"migrate", "api", "worker", "db", "proxy", "signer", "scheduler", "dask-worker"}
    assert services["db"]["image"].startswith("postgres:")
    assert services["api"]["command"][:2] == ["outcrop", "serve"]
    assert services["worker"]["command"] == ["outcrop", "worker"]
    for name in ("api", "worker"):
        url = services[name]["environment"]["OUTCROP_DATABASE_URL"]
        assert url.startswith("${OUTCROP_DATABASE_URL:-postgresql+psycopg://")


def test_compose_commands_exist() -> None:
    services = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["services"]
    for service in ("migrate", "api", "worker"):
        _, command, *options = services[service]["command"]
        done = subprocess.run(
            [sys.executable, "-m", "ground.cli", command, "--help"],
            cwd=ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        for option in (o for o in options if o.startswith("--")):
            assert option in done.stdout


def test_help_loads_no_heavy_library() -> None:
    heavy = {
        "numpy",
        "scipy",
        "numba",
        "ortools",
        "cv2",
        "fastapi",
        "sqlalchemy",
        "pydantic",
        "shapely",
        "matplotlib",
    }
    code = (
        "import sys\nfrom ground.cli.main import app, register_all\nregister_all()\n"
        f"print(sorted({heavy!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_help_is_whole_and_drawn_without_rich() -> None:
    code = "import sys\nfrom ground.cli.main import main\ntry: main()\nfinally: print('rich' in sys.modules)"
    for words, told in (
        ((), "Plan a mission's day on the server. Needs a server."),
        (("mission",), "Needs no"),
    ):
        order = [sys.executable, "-c", code, *words, "--help"]
        done = subprocess.run(order, cwd=ROOT, capture_output=True, text=True, check=True)
        assert told in " ".join(done.stdout.split())
        assert done.stdout.split()[-1] == "False"


def test_wheel_names_every_room() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    wheel = project["tool"]["hatch"]["build"]["targets"]["wheel"]
    rooms = ["mission", "executive", "planner", "rover_iface", "neighbours", "ground", "web"]
    assert wheel["packages"] == rooms
    assert wheel["force-include"] == {"migrations": "ground/migrations"}


def test_navigation_of_the_docs_is_complete() -> None:
    text = (ROOT / "mkdocs.yml").read_text()
    listed = set(re.findall(r"([\w/-]+\.md)", text))
    pages = {p.relative_to(ROOT / "docs").as_posix() for p in (ROOT / "docs").rglob("*.md")}
    assert listed == pages


def test_links_inside_the_docs_lead_somewhere() -> None:
    broken = []
    for page in [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]:
        for link in re.findall(r"\]\(([^)#\s]+)", page.read_text()):
            if "://" not in link and not (page.parent / link).exists():
                broken.append((page.name, link))
    assert broken == []


def test_studies_and_benchmarks_named_in_the_docs_exist() -> None:
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    text = "\n".join(page.read_text() for page in pages)
    named = set(re.findall(r"-m ((?:studies|benchmarks)\.[\w.]*\w)", text))
    named |= {n.replace("/", ".") for n in re.findall(r"`((?:studies|benchmarks)/[\w/]+)\.py", text)}
    assert {"studies.full_day", "studies.subframe_day"} <= named
    places = {n: n.replace(".", "/") for n in named}
    files = {n: (ROOT / f"{at}.py", ROOT / at / "__main__.py") for n, at in places.items()}
    assert {n for n, either in files.items() if not any(file.is_file() for file in either)} == set()


def test_files_named_in_the_pages_on_how_to_add_exist() -> None:
    pages = list((ROOT / "docs/how-to").glob("add-*.md"))
    assert len(pages) >= 5
    named = {(p.name, path) for p in pages for path in re.findall(r"`((?:\w+/)+[\w.-]*)`", p.read_text())}
    assert {(page, path) for page, path in named if not (ROOT / path).exists()} == set()


def test_generated_tables_stand_on_pages_of_results_alone() -> None:
    marked = {
        p.relative_to(ROOT / "docs") for p in (ROOT / "docs").rglob("*.md") if "<!-- begin:" in p.read_text()
    }
    assert marked
    assert {page.parts[0] for page in marked} == {"results"}


def test_study_is_told_when_the_page_has_no_place_for_its_table(tmp_path: Path) -> None:
    page = tmp_path / "results" / "tracking.md"
    page.parent.mkdir()
    page.write_text("# Results\n\n<!-- begin:steps -->\nold\n<!-- end:steps -->\n")
    write_section(tmp_path, "tracking", "steps", "| new |\n")
    assert page.read_text() == "# Results\n\n<!-- begin:steps -->\n| new |\n<!-- end:steps -->\n"
    with pytest.raises(ValueError, match=r"tracking\.md has 0 sections between begin:orbit and end:orbit"):
        write_section(tmp_path, "tracking", "orbit", "| new |\n")


@pytest.mark.parametrize("folder", ["studies", "benchmarks"])
def test_every_study_and_benchmark_can_be_imported(folder: str) -> None:
    modules = [m.name for m in pkgutil.walk_packages([str(ROOT / folder)], f"{folder}.") if not m.ispkg]
    assert len(modules) > 10
    for name in modules:
        importlib.import_module(name)


def built(site: Path) -> subprocess.CompletedProcess[str]:
    """Build a copy of the documentation in `site`."""
    command = [str(Path(sys.executable).parent / "zensical"), "build", "--strict"]
    return subprocess.run(command, cwd=site, capture_output=True, text=True, check=False, timeout=300)


def test_docs_build_without_a_warning_and_a_dead_link_fails(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "docs", tmp_path / "docs")
    shutil.copy(ROOT / "mkdocs.yml", tmp_path)
    done = built(tmp_path)
    assert done.returncode == 0, (done.stdout + done.stderr)[-2000:]
    page = (tmp_path / "site" / "concepts" / "architecture" / "index.html").read_text()
    assert 'src="../../img/rooms.svg"' in page
    assert (tmp_path / "site" / "search.json").stat().st_size > 100_000
    with (tmp_path / "docs" / "index.md").open("a") as file:
        file.write("\n[dead](concepts/odds.md#nothing-of-this-name)\n")
    assert built(tmp_path).returncode != 0


def test_the_wheel_holds_what_the_code_reads_beside_itself() -> None:
    """Whatever git keeps beside modules of the rover: camera presets, profiles, the network and its note."""
    held = {one.distribution_path for one in WheelBuilder(str(ROOT)).recurse_included_files()}
    beside = {name for name in TRACKED if name.startswith("rover_iface/") and not name.endswith(".py")}
    assert "rover_iface/vision/learned/descriptor.onnx" in beside
    assert beside <= held
