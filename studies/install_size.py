"""What `pip install outcrop` brings and what each extra adds, in MB of files of the packages installed here.

    python -m studies.install_size

Sizes are read from the files that each installed package lists; every package of an extra must be installed
(`pip install 'outcrop[all]'`, or the environment of the tests). Byte code counts.
"""

from __future__ import annotations

import importlib.metadata as metadata
import platform
import sys
from collections.abc import Iterable
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

APART = ("test", "docs", "bench", "build", "release", "all")
"""Extras that are for developers, or a sum of others."""


def size_mb(name: str) -> float:
    """Return the size of a package's own files, MB."""
    files = (Path(str(file.locate())) for file in metadata.distribution(name).files or ())
    return sum(path.stat().st_size for path in files if path.is_file()) / 1e6


def closure(lines: Iterable[str], extra: str = "") -> set[str]:
    """Return the names of the packages that requirements bring here, those of theirs taken in.

    Raises
    ------
    PackageNotFoundError
        If one is not installed.
    """
    found: set[str] = set()
    waiting = [(Requirement(line), extra) for line in lines]
    while waiting:
        asked, for_extra = waiting.pop()
        if asked.marker is not None and not asked.marker.evaluate({"extra": for_extra}):
            continue
        name = canonicalize_name(asked.name)
        wanted = metadata.requires(name) or []
        if name not in found:
            waiting += [(Requirement(line), "") for line in wanted]
        waiting += [(Requirement(line), each) for each in asked.extras for line in wanted if "extra" in line]
        found.add(name)
    return found


def main() -> None:
    """Print the table."""
    told = metadata.requires("outcrop") or []
    extras = sorted(set(metadata.metadata("outcrop").get_all("Provides-Extra") or ()) - set(APART))
    base = closure(told)
    total = sum(map(size_mb, base))
    largest = sorted(((size_mb(name), name) for name in base), reverse=True)[:8]
    print(f"`python -m studies.install_size`, Python {platform.python_version()} on {sys.platform}.\n")
    print("| install | packages | MB | most of it |\n|---|---|---|---|")
    words = ", ".join(f"{name} {mb:.0f}" for mb, name in largest)
    print(f"| `outcrop` | {len(base)} | {total:.0f} | {words} |")
    everything = set(base)
    for extra in extras:
        more = closure(told, extra) - base
        everything |= more
        sizes = sorted(((size_mb(name), name) for name in more), reverse=True)
        words = ", ".join(f"{name} {mb:.0f}" for mb, name in sizes[:4] if mb >= 1)
        print(f"| `[{extra}]` adds | {len(more)} | {sum(mb for mb, _ in sizes):.0f} | {words} |")
    print(f"| `[all]` | {len(everything)} | {sum(map(size_mb, everything)):.0f} | |")


if __name__ == "__main__":
    main()
