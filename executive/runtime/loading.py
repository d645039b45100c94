"""From the text of a plan to what the engine runs, with everything that is wrong with it."""

from __future__ import annotations

import hashlib

from executive.crl import CrlValidationError, Plan
from executive.crl.dictionary import Dictionary
from executive.crl.nodes import Node, walk_plan
from executive.crl.printer import canonical_node, canonical_text
from executive.crl.reader import parse
from executive.crl.validate import check
from executive.engine.compile_plan import compile_plan
from executive.engine.spec import PlanSpec


def load_plan(plan: str | Plan, *, trusted: bool = False, dictionary: Dictionary | None = None) -> PlanSpec:
    """Return a plan ready to run. A text is validated unless it is `trusted` (it was validated before).

    With a `dictionary` its actions, parameters and keys are held to that.

    Raises
    ------
    CrlValidationError
        With all findings, if the text is not a valid plan.
    """
    if isinstance(plan, str):
        if trusted:
            plan = parse(plan)
        else:
            commands = None if dictionary is None else dictionary.commands
            telemetry = None if dictionary is None else dictionary.telemetry
            report = check(plan, commands=commands, telemetry=telemetry)
            if report.plan is None or report.errors:
                raise CrlValidationError(report.findings)
            plan = report.plan
    text = canonical_text(plan)
    digest = hashlib.sha256(text.encode()).hexdigest()
    return compile_plan(plan, digest=digest, text=text, identity=TaskTexts(text))


class TaskTexts:
    """Canonical texts of the tasks of a plan by id, read from its text when the first one is asked for."""

    def __init__(self, plan_text: str) -> None:
        self._plan_text = plan_text
        self._nodes: dict[str, Node] = {}

    def __call__(self, task: str) -> str:
        if not self._nodes:
            self._nodes = {node.id: node for node in walk_plan(parse(self._plan_text))}
        return canonical_node(self._nodes[task])


def load_replacement(text: str) -> PlanSpec | str:
    """Return the plan of a replacing text, or why it is rejected."""
    try:
        return load_plan(text)
    except CrlValidationError as error:
        return str(error)
