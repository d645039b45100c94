"""Pack what flies into one file that Python runs: the modules that `ground.uplink.onboard` needs, compiled.

The list is found, not kept: every module of ours that the program imports, wherever it does so. Source and
byte code of the Python that packs are both in it; another Python takes the source. The same tree gives the
same file.
"""

from __future__ import annotations

import _imp
import argparse
import ast
import importlib._bootstrap_external
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ENTRY = "ground.uplink.onboard"
ROOMS = ("executive", "ground")
MOMENT = (2020, 1, 1, 0, 0, 0)
"""The time of each file in the archive: a build depends on the tree alone."""
MAIN = f"import sys\nfrom {ENTRY} import main\nsys.exit(main())\n"


def path_of(module: str) -> Path | None:
    """Return the file of a module of ours, None of what is none."""
    place = ROOT.joinpath(*module.split("."))
    for path in (place / "__init__.py", place.with_suffix(".py")):
        if path.is_file():
            return path
    return None


def imports_of(path: Path) -> set[str]:
    """Return the modules of ours that a file imports, also inside functions, but for types alone."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    skipped = {
        id(inner)
        for node in ast.walk(tree)
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test)
        for body in node.body
        for inner in ast.walk(body)
    }
    found: set[str] = set()
    for node in ast.walk(tree):
        if id(node) in skipped:
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name for name in found if name.split(".")[0] in ROOMS and path_of(name) is not None}


def needed() -> dict[str, Path]:
    """Return the modules of the program by name, packages above them included."""
    found: dict[str, Path] = {}
    waiting = [ENTRY]
    while waiting:
        name = waiting.pop()
        for depth in range(1, name.count(".") + 2):
            part = ".".join(name.split(".")[:depth])
            path = path_of(part)
            if part not in found and path is not None:
                found[part] = path
                waiting += imports_of(path)
    return dict(sorted(found.items()))


def main(target: Path) -> None:
    """Write the archive."""
    entries: dict[str, bytes] = {"__main__.py": MAIN.encode(), "LICENSE": (ROOT / "LICENSE").read_bytes()}
    for path in needed().values():
        name = path.relative_to(ROOT).as_posix()
        source = path.read_bytes()
        code = compile(source, name, "exec", dont_inherit=True)
        entries[name] = source
        # byte code with the hash of its source, not its time: times in a zip are local and would not match
        digest = _imp.source_hash(importlib._bootstrap_external._RAW_MAGIC_NUMBER, source)
        compiled = importlib._bootstrap_external._code_to_hash_pyc(code, digest, False)
        entries[f"{name}c"] = bytes(compiled)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for name, content in sorted(entries.items()):
            info = zipfile.ZipInfo(name, MOMENT)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, content)
    sys.stdout.write(f"{target}: {target.stat().st_size / 2**20:.2f} MB, {len(needed())} modules\n")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="build-onboard", description=__doc__)
    parser.add_argument("file", type=Path, nargs="?", default=Path("outcrop-onboard.pyz"))
    main(parser.parse_args().file)
