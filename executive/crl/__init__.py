"""The Contingent Rover Language: text, nodes, canonical form, JSON form, validator."""

from executive.crl.errors import (
    CrlError,
    CrlFormError,
    CrlSyntaxError,
    CrlValidationError,
    Finding,
    Severity,
)
from executive.crl.json_form import from_json, to_json
from executive.crl.nodes import Plan
from executive.crl.printer import canonical_text, digest, readable_text
from executive.crl.reader import parse
from executive.crl.validate import Report, check, load, validate

__all__ = [
    "CrlError",
    "CrlFormError",
    "CrlSyntaxError",
    "CrlValidationError",
    "Finding",
    "Plan",
    "Report",
    "Severity",
    "canonical_text",
    "check",
    "digest",
    "from_json",
    "load",
    "parse",
    "readable_text",
    "to_json",
    "validate",
]
