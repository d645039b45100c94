"""Each rule of `scripts/check` on the shape of the tree fails on a planted fault."""

from __future__ import annotations

import runpy
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

pytestmark = pytest.mark.xdist_group("house")
ROOT = Path(__file__).resolve().parents[2]
DEEP = "".join(f"    if x == {n}:\n        return {n}\n" for n in range(16))

FAULTS = {
    "planner/forgotten.py": "",
    "planner/tangled.py": f"def tangle(x: int) -> int:\n{DEEP}    return -1\n",
    "executive/untyped.py": "def plan(day: dict[str, list[int]]) -> 'Mapping[str, Any]':\n    return day\n",
    "executive/documents.py": """
from typing import Any, TypeAlias
Form = dict[str, Any]
Forms: TypeAlias = "list[Form]"
""",
    "executive/hidden.py": """
from collections.abc import Mapping
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from executive.documents import Forms as Pages
Typed = Mapping[str, object]


def read(forms: "Pages | None") -> Typed:
    return {}
""",
    "planner/shapeless.py": """
from collections.abc import Callable
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from planner.evaluate.model import Floats as Reals

Pairs = list[Reals]
Rule = Callable[[Reals], float]


def scaled(by: float, values: "Reals", *more: Pairs) -> Reals:
    '''Return values times a number, see (below, above), item[0] and (n).'''


def centred(values: Reals) -> Reals:
    '''Return values [n] less their mean.'''


def judged(rule: Rule, by: float) -> None:
    '''Take no array, but what takes one.'''


def _own(values: Reals) -> None:
    pass


class Moved:
    '''Points (n, 3), m.'''

    def __init__(self, points: Reals) -> None:
        pass


class Kept:
    '''What is kept.'''

    def __init__(self, points: Reals) -> None:
        pass

    def near(self, points: Reals) -> None:
        '''See `Moved`.'''
""",
    "executive/uses_them.py": (
        "import executive.hidden, executive.untyped, planner.shapeless, planner.tangled\n"
    ),
    "mission/astray.py": "",
    "mission/first.py": "import mission.second\n",
    "mission/second.py": "import mission.first\n",
    "planner/left/__init__.py": "",
    "planner/left/a.py": "import planner.right.b\n",
    "planner/left/c.py": "",
    "planner/right/__init__.py": "",
    "planner/right/b.py": "import planner.left.c\n",
    "ground/resources/sols/rules.py": "import ground.resources.sols.kind\n",
    "ground/resources/sols/answer_sol.py": "import starlette.responses\n",
    "ground/resources/comments/reply.py": "import ground.resources.kinds\n",
    **{f"web/page_{n}.py": "" for n in range(31)},
}


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the product and its rules."""
    tree = tmp_path_factory.mktemp("tree")
    command = ["git", "ls-files", "-co", "--exclude-standard"]
    listed = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout
    for path in map(Path, listed.splitlines()):
        wanted = path.suffix == ".py" or path.name in {"pyproject.toml", "house.toml", "py.typed"}
        if wanted and path.parts[0] not in {"tests", "studies", "benchmarks"} and (ROOT / path).is_file():
            (tree / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / path, tree / path)
    return tree


@pytest.fixture(scope="module")
def with_faults(tree: Path) -> Path:
    """Return the copy with every fault planted in it."""
    for name, text in FAULTS.items():
        (tree / name).parent.mkdir(exist_ok=True)
        (tree / name).write_text(text)
    (tree / "web/py.typed").unlink()
    options = tree / "scripts/house.toml"
    text = options.read_text().replace("kernels = [", 'kernels = [\n  "planner/tangled.py:tangle",')
    options.write_text(text.rstrip() + '\n\n[known.py-typed]\n"executive" = 1\n')
    return tree


@pytest.fixture(scope="module")
def house(with_faults: Path) -> str:
    done = subprocess.run(
        [sys.executable, str(with_faults / "scripts/house.py")],
        cwd=with_faults,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 1, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def imports(with_faults: Path) -> str:
    command = [
        sys.executable,
        "-c",
        "from importlinter.cli import lint_imports_command as c; c()",
        "--no-cache",
    ]
    done = subprocess.run(command, cwd=with_faults, capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    "finding",
    [
        "unimported: planner/forgotten.py: no product module imports planner.forgotten",
        "complexity: planner/tangled.py: line 1: `tangle` is too complex (17 > 15)",
        "folder: web: 32 modules; a folder holds at most 30",
        "untyped-signature: executive/untyped.py: line 1: plan has 'Mapping[str, Any]'",
        "untyped-signature: executive/hidden.py: line 9: read has 'Pages | None'",
        "shapes: planner/shapeless.py: line 11: scaled states no shape of values, more",
        "shapes: planner/shapeless.py: line 37: Kept.__init__ states no shape of points",
        "py-typed: web: web/py.typed is missing",
    ],
)
def test_house_tells_a_planted_fault(house: str, finding: str) -> None:
    assert finding in house.splitlines()


def test_house_tells_nothing_of_modules_that_are_imported_and_plain(house: str) -> None:
    told = {line.split(": ")[1] for line in house.splitlines() if line.startswith("unimported: ")}
    assert "planner/tangled.py" not in told
    assert "executive/untyped.py" not in told


def test_house_asks_for_shapes_only_where_a_public_function_takes_an_array(house: str) -> None:
    told = [line for line in house.splitlines() if line.startswith("shapes: ")]
    assert {line.split(": ")[1] for line in told} == {"planner/shapeless.py"}
    assert len(told) == 2


def test_house_looks_behind_the_names_of_types_and_no_further(house: str) -> None:
    told = [line for line in house.splitlines() if "executive/hidden.py" in line]
    assert len(told) == 1


def test_named_kernel_counts_only_if_it_is_compiled(house: str) -> None:
    assert "planner/tangled.py:tangle is not a compiled function over the limit" in house


def test_exception_that_is_mended_fails_the_check_until_it_is_taken_out(house: str, tmp_path: Path) -> None:
    assert "exceptions of house.toml are mended; take them out with --tighten" in house
    rules = runpy.run_path(str(ROOT / "scripts/house.py"))
    left = [rules["Finding"]("folder", "ground/services", ""), rules["Finding"]("complexity", "new.py", "")]
    known = {"folder": {"ground/services": 2, "gone": 1}, "py-typed": {"executive": 1}}
    smaller = rules["tightened"](left, known)
    assert smaller == {"folder": {"ground/services": 1}}
    options = tmp_path / "house.toml"
    options.write_text('modules-in-a-folder = 30\n\n[known.py-typed]\n"executive" = 1\n')
    rules["write_known"](options, smaller)
    assert tomllib.loads(options.read_text()) == {"modules-in-a-folder": 30, "known": smaller}


def test_import_linter_tells_a_module_under_no_layer(imports: str) -> None:
    assert "Inside mission: day > codec > constraints > values BROKEN" in imports
    for module in ("mission.astray", "planner.forgotten", "executive.untyped"):
        assert module in imports


def test_every_room_stands_under_layers_that_cover_all_of_it() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    contracts = project["tool"]["importlinter"]["contracts"]
    covered = {room for c in contracts if c.get("exhaustive") for room in c["containers"]}
    rooms = set(project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"])
    assert covered == rooms - {"web"}  # one module
    assert not any(c.get("exhaustive_ignores") or c.get("ignore_imports") for c in contracts)


def test_import_linter_tells_what_climbs_in_a_noun_and_a_use_case_that_knows_the_web(imports: str) -> None:
    for broken in ("Inside a noun: routes > use cases > kind", "No web framework below the routes"):
        assert any(broken in line and "BROKEN" in line for line in imports.splitlines())
    assert "ground.resources.sols.rules -> ground.resources.sols.kind" in imports
    assert "ground.resources.sols.answer_sol -> starlette" in imports
    assert "No cycles are allowed in ground.resources." in imports


def test_import_linter_tells_circles_of_modules_and_of_folders(imports: str) -> None:
    assert "No circle of modules or folders inside a room BROKEN" in imports
    assert "mission.first" in imports
    assert ".left" in imports
    assert ".right" in imports
