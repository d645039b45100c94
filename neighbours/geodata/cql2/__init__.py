"""CQL2 text, the filter language of OGC API Features: read, checked against what can be asked, evaluated.

What there is of OGC 21-065r2: Basic CQL2, advanced comparison (`like`, `between`, `in`), comparison without
case and accents, comparison of properties, all spatial and temporal functions on all literals of geometry.
Not there: arithmetic, arrays and functions of one's own; each is refused by its name.
"""

from neighbours.geodata.cql2.checks import checked
from neighbours.geodata.cql2.errors import Cql2Error
from neighbours.geodata.cql2.evaluate import Subject, holds, moved
from neighbours.geodata.cql2.expression import Expression, Form, Instant, Interval, Scalar
from neighbours.geodata.cql2.reader import read_cql2

__all__ = [
    "Cql2Error",
    "Expression",
    "Form",
    "Instant",
    "Interval",
    "Scalar",
    "Subject",
    "checked",
    "holds",
    "moved",
    "read_cql2",
]
