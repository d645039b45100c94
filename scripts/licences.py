"""Print the packages of a CycloneDX document with their licences, as a table in Markdown."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def licence(component: Mapping[str, Any]) -> str:
    """Return the licences that a component states; `not stated` where it has none."""
    found = []
    for entry in component.get("licenses", ()):
        told = entry.get("license", {})
        # a text of several lines is the licence itself, not its name
        name = entry.get("expression") or told.get("id") or str(told.get("name", "")).splitlines()[0]
        if name and name not in found:
            found.append(name)
    return "; ".join(found) or "not stated"


def main(path: str) -> None:
    """Print the table."""
    document = json.loads(Path(path).read_text(encoding="utf-8"))
    rows = sorted((c["name"].lower(), c.get("version", ""), licence(c)) for c in document["components"])
    print("| package | version | licence |\n|---|---|---|")
    for name, version, told in rows:
        print(f"| {name} | {version} | {told.replace('|', '/')} |")


if __name__ == "__main__":
    main(sys.argv[1])
