"""The validator: everything section 9 says about a plan, in one pass over its text.

The checks stand in `executive.crl.checks`, one module for each idea; this module decides which of them make
sense after the others and puts the findings into the order of the text.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executive.crl.checks.controllability import check_controllability
from executive.crl.checks.dictionaries import check_commands, check_telemetry
from executive.crl.checks.envelope import check_envelope
from executive.crl.checks.index import Index
from executive.crl.checks.names import check_keys, check_names, check_references
from executive.crl.checks.network import check_network
from executive.crl.checks.reach import check_reach
from executive.crl.checks.resources import check_resources
from executive.crl.checks.values import check_values
from executive.crl.checks.waiting import check_waiting
from executive.crl.collector import paused_collector
from executive.crl.dictionary import CommandDictionary, TelemetryDictionary
from executive.crl.errors import CrlValidationError, Finding
from executive.crl.nodes import Plan
from executive.crl.reader import Front, read


@dataclass(frozen=True, slots=True)
class Report:
    """The plan as far as it could be read, and all findings in the order of the text."""

    plan: Plan | None
    findings: tuple[Finding, ...]

    @property
    def errors(self) -> tuple[Finding, ...]:
        return tuple(f for f in self.findings if f.is_error)

    @property
    def valid(self) -> bool:
        return not self.errors


def check(
    text: str,
    *,
    commands: CommandDictionary | None = None,
    telemetry: TelemetryDictionary | None = None,
    levels: Mapping[str, float] | None = None,
    front: Front | None = None,
) -> Report:
    """Read and validate a text.

    Parameters
    ----------
    commands, telemetry
        The rover's dictionaries; without them actions, parameters and keys are not looked up.
    levels
        What the consumables hold at the start of the plan, by database key, for the resource envelope (W064).
    front
        Expands the text first (`expand.expand_items`); the findings point into the text as it was written.
    """
    with paused_collector():
        return _check(text, commands, telemetry, levels, front)


def _check(
    text: str,
    commands: CommandDictionary | None,
    telemetry: TelemetryDictionary | None,
    levels: Mapping[str, float] | None,
    front: Front | None,
) -> Report:
    reading = read(text, front=front)
    if reading.plan is None:
        return Report(None, reading.findings)
    found = _findings(Index(reading.plan, reading.ids), commands, telemetry, levels)
    return Report(reading.plan, _in_order([*reading.findings, *found]))


def validate(
    plan: Plan,
    *,
    commands: CommandDictionary | None = None,
    telemetry: TelemetryDictionary | None = None,
    levels: Mapping[str, float] | None = None,
) -> tuple[Finding, ...]:
    """Return the findings on a plan that was built rather than read."""
    return _in_order(_findings(Index(plan), commands, telemetry, levels))


def load(
    text: str,
    *,
    commands: CommandDictionary | None = None,
    telemetry: TelemetryDictionary | None = None,
) -> Plan:
    """Return the plan of a text that must be valid.

    Raises
    ------
    CrlValidationError
        With all findings, if any of them is an error.
    """
    report = check(text, commands=commands, telemetry=telemetry)
    if report.plan is None or not report.valid:
        raise CrlValidationError(report.findings)
    return report.plan


def _findings(
    index: Index,
    commands: CommandDictionary | None,
    telemetry: TelemetryDictionary | None,
    levels: Mapping[str, float] | None,
) -> list[Finding]:
    check_names(index)
    check_references(index)
    check_keys(index)
    check_values(index)
    check_waiting(index)
    check_network(index, check_controllability)
    check_resources(index)
    check_envelope(index, levels)
    check_reach(index)
    if commands is not None:
        check_commands(index, commands)
    if telemetry is not None:
        check_telemetry(index, telemetry)
    return index.findings


def _in_order(findings: list[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(findings, key=lambda f: (f.line, f.column, f.code)))
