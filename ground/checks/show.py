"""A plan check as text, as one page of HTML that loads nothing, and as JUnit's XML for pipelines."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree

from ground.checks.report import Mark, PlanCheck
from ground.reports.page import page, safe, table

MOST_CHANGES = 200


def text_lines(found: PlanCheck) -> Iterator[str]:
    """Yield the report for a terminal, the verdict last."""
    for item in found.items:
        yield f"{item.mark:9}  {item.stage:12}  {item.name}: {item.said}"
    if found.difference is not None:
        for change in found.difference.changes[:MOST_CHANGES]:
            yield f"{'':9}  {change.group:12}  {change.line()}"
    counts = ", ".join(f"{found.count(mark)} {mark}" for mark in Mark if found.count(mark))
    spent = sum(found.seconds.values())
    yield f"{'PASSED' if found.passed else 'FAILED'}: {counts}; {spent:.1f} s of this process"


def html_page(found: PlanCheck) -> str:
    """Return the report as one page."""
    return page(f"Plan check: {found.plan}", _parts(found))


def _parts(found: PlanCheck) -> Iterator[str]:
    verdict = "The plan passed." if found.passed else "The plan failed."
    yield f'<p class="{"go" if found.passed else "stop"}">{verdict}</p>'
    yield f"<p>CRL {safe(found.crl_sha256 or 'cannot be read')}</p>"
    rows = [(i.mark, i.stage, i.name, i.said) for i in found.items]
    yield table(("", "stage", "what", "found"), rows)
    if found.difference is not None:
        yield "<h2>Difference to the approved plan</h2>"
        if found.difference.same:
            yield "<p>Both mean the same.</p>"
        changes = found.difference.changes[:MOST_CHANGES]
        yield table(("group", "change"), [(c.group, c.line()) for c in changes])
        left = len(found.difference.changes) - len(changes)
        if left > 0:
            yield f"<p>{left} more are in the JSON form.</p>"
    yield table(("stage", "processor seconds"), list(found.seconds.items()), numbers=(1,))


def junit_xml(found: PlanCheck) -> str:
    """Return the report as JUnit's XML: a case for each item, failures and undecided ones marked."""
    suite = ElementTree.Element(
        "testsuite",
        name="outcrop plan ci",
        tests=str(len(found.items)),
        failures=str(found.count(Mark.FAILED)),
        errors="0",
        skipped=str(found.count(Mark.UNDECIDED)),
        time=f"{sum(found.seconds.values()):.3f}",
    )
    for item in found.items:
        case = ElementTree.SubElement(
            suite, "testcase", classname=f"plan.{item.stage.replace(' ', '_')}", name=_printable(item.name)
        )
        if item.mark is Mark.FAILED:
            ElementTree.SubElement(case, "failure", message=_printable(item.said))
        elif item.mark is Mark.UNDECIDED:
            ElementTree.SubElement(case, "skipped", message=_printable(item.said))
        else:
            ElementTree.SubElement(case, "system-out").text = _printable(item.said)
    suites = ElementTree.Element("testsuites")
    suites.append(suite)
    return ElementTree.tostring(suites, encoding="unicode", xml_declaration=True) + "\n"


def _printable(text: str) -> str:
    """Return a text without the characters that XML cannot hold."""
    return "".join(c if c in "\t\n" or (c >= " " and not "\ud800" <= c <= "\udfff") else "?" for c in text)
