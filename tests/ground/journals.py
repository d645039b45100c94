"""Journals with a value changed by hand, sums and all."""

from __future__ import annotations

import re
import zlib
from pathlib import Path


def rewritten(path: Path, key: str, word: str) -> int:
    """Put a JSON word in the place of every value of a key, and mend the checksums; return how many lines."""
    lines, count = [], 0
    for line in path.read_text("utf-8").splitlines():
        body = line.rpartition(',"crc":"')[0]
        changed = re.sub(rf'("{re.escape(key)}":)(?:"[^"]*"|[^,}}\]]+)', rf"\g<1>{word}", body)
        count += changed != body
        lines.append(f'{changed},"crc":"{zlib.crc32(changed.encode()):08x}"}}')
    path.write_text("".join(f"{line}\n" for line in lines), "utf-8")
    return count
