"""All tables of the repository: whoever needs the whole schema imports it from here.

The tables of a noun stand in its `row.py`, which is found by its name.
"""

from __future__ import annotations

import pkgutil
from importlib import import_module
from importlib.util import find_spec

import ground.resources
from ground.gdr.base import Base

OTHERS = ("ground.gdr.history", "ground.jobs.row", "ground.records.idempotency")
NOUNS = (noun.name for noun in pkgutil.iter_modules(ground.resources.__path__) if noun.ispkg)
for _module in (*OTHERS, *(f"ground.resources.{noun}.row" for noun in NOUNS)):
    if find_spec(_module) is not None:
        import_module(_module)
METADATA = Base.metadata
