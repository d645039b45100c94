"""What an install without extras does: commands that need one name it in a line, the others work."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from ground.extras import EXTRAS, missing_extra
from ground.jobs.queue import problem_of
from rover_iface.registry import find_rover
from tests.rover_iface.worlds import plane

ROOT = Path(__file__).parents[2]
LIGHT = (
    "import sys\nfor name in {names!r}: sys.modules[name] = None\nfrom ground.cli import main\n"
    "sys.argv = ['outcrop', *sys.argv[1:]]\nmain()"
)
"""A program in which packages of extras cannot be imported, as where they are not installed."""


def light(*words: str, env: dict[str, str] | None = None) -> subprocess.CompletedProcess[str]:
    program = LIGHT.format(names=sorted(EXTRAS))
    return subprocess.run(
        [sys.executable, "-c", program, *words], capture_output=True, text=True, env=env, check=False
    )


def project() -> dict[str, object]:
    found: dict[str, object] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return found


def test_every_package_named_belongs_to_its_extra_and_to_no_base_install() -> None:
    import importlib.metadata as metadata

    told = project()
    extras, base = told["optional-dependencies"], told["dependencies"]
    assert isinstance(extras, dict)
    assert isinstance(base, list)
    by_import = metadata.packages_distributions()
    for package, extra in EXTRAS.items():
        dists = {canonicalize_name(name) for name in by_import.get(package, [package.replace("_", "-")])}
        asked = {canonicalize_name(Requirement(line).name) for line in extras[extra]}
        assert dists & asked, f"{package} is not of the extra {extra}: {dists}, {asked}"
        assert not dists & {canonicalize_name(Requirement(line).name) for line in base}


def test_the_extra_all_holds_every_other() -> None:
    extras = project()["optional-dependencies"]
    assert isinstance(extras, dict)
    (line,) = extras["all"]
    assert Requirement(line).extras == set(extras) - {"all", "test", "docs", "bench", "build", "release"}


def test_a_command_without_its_extra_says_how_to_get_it(tmp_path: Path) -> None:
    done = light("sim", "render", "--out", str(tmp_path / "view.png"))
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert re.fullmatch(
        r"outcrop: this needs the package (cv2|embreex), .*: pip install 'outcrop\[vision\]'", line
    )


def test_a_postgresql_address_without_its_driver_names_the_extra(tmp_path: Path) -> None:
    env = {"OUTCROP_DATA_DIR": str(tmp_path), "OUTCROP_DATABASE_URL": "postgresql://127.0.0.1/none"}
    done = light("migrate", env={"PATH": "/usr/bin:/bin", "PYTHONPATH": str(ROOT), **env})
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    assert "outcrop[postgres]" in done.stderr


@pytest.mark.parametrize("rover", ["subframe", "full"])
def test_a_rover_that_sees_says_what_it_needs_before_its_day(
    rover: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rover_iface.errors import MissingExtraError

    monkeypatch.setitem(sys.modules, "cv2", None)
    world = {"format": "world/1", "name": "flat", "targets": []}
    with pytest.raises(MissingExtraError, match=r"cv2: pip install 'outcrop\[vision\]'"):
        find_rover(rover)(world, terrain=plane())


def test_work_that_misses_a_package_fails_with_the_way_to_get_it() -> None:
    problem = problem_of(ModuleNotFoundError("No module named 'cv2'", name="cv2.dnn"))
    assert "outcrop[vision]" in str(problem["detail"])
    assert missing_extra(ModuleNotFoundError("No module named 'grounds'", name="grounds")) is None


def test_the_published_constraints_are_those_of_the_lock() -> None:
    lock = (ROOT / "requirements" / "test.lock").read_text(encoding="utf-8")
    pinned = re.findall(r"^([a-z0-9][^ \\]*==[^ \\]+(?: ; [^\\]+?)?) ?\\?$", lock, re.MULTILINE)
    told = (ROOT / "requirements" / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert [line for line in told if not line.startswith("#")] == pinned
