"""What the live examples ask of the executive, in the browser: check a source, run it against a world."""

import json

from executive.crl.expand import expand_items
from executive.crl.printer import canonical_text
from executive.crl.validate import check
from executive.errors import ScenarioError
from executive.runtime.scenario import parse_scenario, run_scenario


def answer(source: str, world: str) -> str:
    """Return, as JSON, the findings of a source and, if it is valid, what came of it in a world."""
    report = check(source, front=expand_items)
    found: dict[str, object] = {"findings": [finding.to_json() for finding in report.findings]}
    if report.plan is None or not report.valid:
        return json.dumps(found)
    try:
        document = json.loads(world or "{}")
    except ValueError as error:
        return json.dumps({**found, "world": f"the world is not JSON: {error}"})
    try:
        run = run_scenario(parse_scenario({"plan": canonical_text(report.plan), "world": document}, "live"))
    except ScenarioError as error:
        return json.dumps({**found, "world": str(error)})
    return json.dumps({**found, "run": run.to_json()})
