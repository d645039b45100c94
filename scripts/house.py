"""Check the rules of the house that no kept tool checks; part of `scripts/check`.

    python scripts/house.py [--root DIR] [--tighten]

========================  ==========================================================================
``unimported``            a product module that no product module imports; imports inside functions,
                          entry points and folders whose modules are found by name count
``complexity``            a function over `max-complexity` of `pyproject.toml` (ruff's C901) that is
                          none of the compiled kernels named in `house.toml`
``folder``                a folder with more modules than `house.toml` allows
``untyped-signature``     ``dict[str, Any]`` in a public signature outside the codecs, by its own name or by
                          one that stands for it
``shapes``                a public function that takes arrays and whose docstring (for a method, its own
                          or its class's) states no shape: ``[n, 3]``, ``[3]``, ``[...]`` or ``(n, 3)``;
                          "See `Base`" sends an override to what it overrides
``py-typed``              a public package without ``py.typed``
========================  ==========================================================================

Layers and circles are rules of import-linter. What is known to break a rule stands in `house.toml` with its
count, which may only shrink: an exception that is no longer needed fails the check, and ``--tighten`` takes
it out.
"""

from __future__ import annotations

import argparse
import ast
import json
import re
import subprocess
import sys
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

HOUSE = "scripts/house.toml"
RULES = ("unimported", "complexity", "folder", "untyped-signature", "shapes", "py-typed")


@dataclass(frozen=True)
class Finding:
    """A place that breaks a rule; findings of one rule and file are counted together."""

    rule: str
    file: str
    text: str


class House:
    """The tree under `root` and what its `pyproject.toml` and `scripts/house.toml` say of it."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
        self.options = tomllib.loads((root / HOUSE).read_text(encoding="utf-8"))
        self.packages: list[str] = self.project["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]

    @cached_property
    def files(self) -> dict[str, ast.Module]:
        """Return the syntax tree of each product module by its path."""
        paths = (p for package in self.packages for p in sorted((self.root / package).rglob("*.py")))
        return {
            path.relative_to(self.root).as_posix(): ast.parse(path.read_text(encoding="utf-8"))
            for path in paths
            if "node_modules" not in path.parts
        }

    def findings(self) -> Iterator[Finding]:
        """Yield every place that breaks a rule, exceptions included."""
        yield from self._unimported()
        yield from self._complexity()
        yield from self._folder()
        yield from self._untyped_signatures()
        yield from self._shapes()
        yield from self._py_typed()

    def _unimported(self) -> Iterator[Finding]:
        import grimp

        graph = grimp.build_graph(*self.packages, cache_dir=None)
        entries = self._entry_points()
        for module in sorted(graph.modules):
            name = module.rpartition(".")[2]
            if name == "__main__" or module in entries or graph.find_children(module):
                continue
            if module in self.packages or module.rpartition(".")[0] in self.options["found-by-name"]:
                continue
            if not graph.find_modules_that_directly_import(module):
                yield Finding("unimported", _path(self.root, module), f"no product module imports {module}")

    def _entry_points(self) -> set[str]:
        """Return modules named as `module:attribute`, by the project or in the text of a product module."""
        project = self.project["project"]
        named = list(project.get("scripts", {}).values())
        for group in project.get("entry-points", {}).values():
            named += group.values()
        for tree in self.files.values():
            named += (
                n.value for n in ast.walk(tree) if isinstance(n, ast.Constant) and isinstance(n.value, str)
            )
        return {n.partition(":")[0] for n in named if re.fullmatch(r"[a-z_][\w.]*:[a-z_]\w*", n)}

    def _complexity(self) -> Iterator[Finding]:
        command = ["ruff", "check", "--select", "C901", "--ignore-noqa", "--output-format", "json"]
        command = [sys.executable, "-m", *command, "--no-cache", "--exit-zero", "."]
        done = subprocess.run(command, cwd=self.root, capture_output=True, text=True, check=True)
        kernels, met = set(self.options["kernels"]), set()
        for found in json.loads(done.stdout):
            file = Path(found["filename"]).resolve().relative_to(self.root.resolve()).as_posix()
            name = re.match(r"`(\w+)`", found["message"])
            function = f"{file}:{name[1] if name else '?'}"
            if function in kernels and self._is_compiled(file, found["location"]["row"]):
                met.add(function)
                continue
            yield Finding("complexity", file, f"line {found['location']['row']}: {found['message']}")
        for function in sorted(kernels - met):
            yield Finding("complexity", HOUSE, f"{function} is not a compiled function over the limit")

    def _is_compiled(self, file: str, row: int) -> bool:
        """Return whether the function whose name stands in a row is compiled by numba."""
        for node in ast.walk(self.files[file]):
            if isinstance(node, ast.FunctionDef) and node.lineno == row:
                return any(
                    "njit" in ast.unparse(d) or "compiled" in ast.unparse(d) for d in node.decorator_list
                )
        return False

    def _folder(self) -> Iterator[Finding]:
        most = self.options["modules-in-a-folder"]
        for folder, count in Counter(str(Path(file).parent) for file in self.files).items():
            if count > most:
                yield Finding("folder", folder, f"{count} modules; a folder holds at most {most}")

    def _untyped_signatures(self) -> Iterator[Finding]:
        codecs = set(self.options["codecs"])
        for codec in sorted(codecs - self.files.keys()):
            yield Finding("untyped-signature", HOUSE, f"{codec} is not a module")
        aliases = _names_for(self.files, set(), _is_untyped)
        for file, tree in self.files.items():
            if file in codecs:
                continue
            if any(part.startswith("_") and not part.startswith("__") for part in Path(file).parts):
                continue
            for name, function in _public_functions(tree):
                for annotation in _annotations(function):
                    if _is_untyped(annotation, aliases[file]):
                        text = f"line {function.lineno}: {name} has {ast.unparse(annotation)}"
                        yield Finding("untyped-signature", file, text)

    def _shapes(self) -> Iterator[Finding]:
        arrays = _names_for(self.files, ARRAYS, _is_array)
        for file, tree in self.files.items():
            if any(part.startswith("_") and not part.startswith("__") for part in Path(file).parts):
                continue
            docs = {f"{node.name}.": _docstring(node) for node in tree.body if isinstance(node, ast.ClassDef)}
            for name, function in _public_functions(tree):
                taken = [a.arg for a in _arguments(function) if _names_in(a.annotation) & arrays[file]]
                own = _docstring(function)
                of_class = docs.get(name.removesuffix(function.name), "")
                if taken and not (SHAPE.search(own) or SEE.match(own) or SHAPE.search(of_class)):
                    text = f"line {function.lineno}: {name} states no shape of {', '.join(taken)}"
                    yield Finding("shapes", file, text)

    def _py_typed(self) -> Iterator[Finding]:
        for package in self.packages:
            if not (self.root / package / "py.typed").is_file():
                yield Finding("py-typed", package, f"{package}/py.typed is missing")


ARRAYS = {"NDArray", "ndarray", "ArrayLike"}
SIDE = r"(?:\d+|\.\.\.|[A-Z]|len\(\w+\)|[A-Za-z]\w*(?: [a-z]\w*){0,2}(?: ?[-+*] ?\w+)?)"
SHAPE = re.compile(
    rf"(?<!\w)\[(?:\d+ )?{SIDE}(?:, (?:\d+ )?{SIDE})*\]"  # [n, 3], [2 half + 1, len(xs)], [...]
    rf"|\({SIDE},\)|\((?:{SIDE}, )*\d+(?:, {SIDE})*\)|\([A-Z](?:, [A-Z])+\)"  # (n,), (n, 3), (S, K)
)
SEE = re.compile(r"See `\w")
UNTYPED = re.compile(r"\b(dict|Dict|Mapping|MutableMapping)\[str, (Any|typing\.Any)\]")


def _path(root: Path, module: str) -> str:
    path = Path(*module.split("."))
    return (path / "__init__.py" if (root / path).is_dir() else path.with_suffix(".py")).as_posix()


def _public_functions(
    tree: ast.Module | ast.ClassDef, prefix: str = ""
) -> Iterator[tuple[str, ast.FunctionDef | ast.AsyncFunctionDef]]:
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if not node.name.startswith("_") or node.name == "__init__":
                yield f"{prefix}{node.name}", node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from _public_functions(node, f"{prefix}{node.name}.")


Stands = Callable[[ast.expr, set[str]], bool]
"""Whether a type is one that is looked for, given the names that stand for such in its module."""


def _is_array(kind: ast.expr, known: set[str]) -> bool:
    return bool(_names_in(kind) & known)


def _is_untyped(kind: ast.expr, known: set[str]) -> bool:
    return bool(UNTYPED.search(ast.unparse(kind)) or _names_in(kind) & known)


def _names_for(files: dict[str, ast.Module], names: set[str], stands: Stands) -> dict[str, set[str]]:
    """Return the names that stand for a type in each module: those given, and aliases made or imported, for
    type checkers only too.
    """
    found = {file: set(names) for file in files}
    growing = True
    while growing:
        growing = False
        for file, tree in files.items():
            guarded = [inner for node in tree.body if isinstance(node, ast.If) for inner in node.body]
            more = {n for node in (*tree.body, *guarded) for n in _aliases(node, found, found[file], stands)}
            growing |= not more <= found[file]
            found[file] |= more
    return found


def _aliases(node: ast.stmt, names: dict[str, set[str]], known: set[str], stands: Stands) -> Iterator[str]:
    if isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None:
        told = isinstance(node, ast.AnnAssign) and "TypeAlias" in _names_in(node.annotation)
        if told or isinstance(node.value, ast.Name | ast.Attribute | ast.Subscript | ast.BinOp):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            if stands(node.value, known):
                yield from (t.id for t in targets if isinstance(t, ast.Name))
    elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
        base = node.module.replace(".", "/")
        exported = names.get(f"{base}.py", names.get(f"{base}/__init__.py", set()))
        yield from (a.asname or a.name for a in node.names if a.name in exported)


def _docstring(node: ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef) -> str:
    return " ".join((ast.get_docstring(node) or "").split())


def _names_in(node: ast.AST | None) -> set[str]:
    """Return the last part of each name in a type, also in strings; a callable's arguments are none of it."""
    match node:
        case None:
            return set()
        case ast.Name(id=name):
            return {name}
        case ast.Attribute(attr=name):
            return {name}
        case ast.Constant(value=str(text)):
            return set(re.findall(r"\w+", text))
        case ast.Subscript(value=ast.Name(id="Callable") | ast.Attribute(attr="Callable")):
            return set()
    return set().union(*map(_names_in, ast.iter_child_nodes(node)))


def _arguments(function: ast.FunctionDef | ast.AsyncFunctionDef) -> list[ast.arg]:
    a = function.args
    every = (*a.posonlyargs, *a.args, a.vararg, *a.kwonlyargs, a.kwarg)
    return [argument for argument in every if argument is not None]


def _annotations(function: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[ast.expr]:
    yield from (a.annotation for a in _arguments(function) if a.annotation is not None)
    if function.returns is not None:
        yield function.returns


def over(findings: list[Finding], known: dict[str, dict[str, int]]) -> list[Finding]:
    """Return the findings of each rule and file that has more of them than are known."""
    counts = Counter((f.rule, f.file) for f in findings)
    return [f for f in findings if counts[f.rule, f.file] > known.get(f.rule, {}).get(f.file, 0)]


def tightened(findings: list[Finding], known: dict[str, dict[str, int]]) -> dict[str, dict[str, int]]:
    """Return the known exceptions with what has been mended taken out: no count grows, none is added."""
    counts = Counter((f.rule, f.file) for f in findings)
    left = {
        rule: {file: min(n, counts[rule, file]) for file, n in files.items() if counts[rule, file]}
        for rule, files in known.items()
    }
    return {rule: files for rule, files in left.items() if files}


def write_known(path: Path, known: dict[str, dict[str, int]]) -> None:
    """Replace the tables of exceptions, which end the file."""
    head = re.split(r"^\[known\.", path.read_text(encoding="utf-8"), maxsplit=1, flags=re.MULTILINE)[
        0
    ].rstrip()
    tables = [
        f"[known.{rule}]\n" + "".join(f'"{file}" = {n}\n' for file, n in sorted(files.items()))
        for rule, files in known.items()
    ]
    path.write_text("\n\n".join([head, *(t.rstrip() for t in tables)]) + "\n", encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    """Print what breaks a rule; exit status 1 if anything does."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[1])
    parser.add_argument("--tighten", action="store_true", help="take out exceptions that have been mended")
    given = parser.parse_args(arguments)
    root = given.root.resolve()
    sys.path.insert(0, str(root))
    house = House(root)
    known: dict[str, dict[str, Any]] = house.options.get("known", {})
    findings = list(house.findings())
    if given.tighten:
        write_known(root / HOUSE, tightened(findings, known))
        known = tightened(findings, known)
    broken, mended = over(findings, known), tightened(findings, known) != known
    for f in broken:
        print(f"{f.rule}: {f.file}: {f.text}")
    if mended:
        print("house: exceptions of house.toml are mended; take them out with --tighten")
    print(f"house: {len(broken)} to mend, {len(findings) - len(broken)} known exceptions")
    return 1 if broken or mended else 0


if __name__ == "__main__":
    sys.exit(main())
