"""Golden traces: every scenario file of this folder, and the public ones where they are at hand."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.runtime.scenario import load_scenario, run_scenario
from tests.shared import shared

OWN = sorted((Path(__file__).parent / "scenarios").glob("*.json"))
PUBLIC = [
    "P01-two-tasks-in-sequence",
    "P02-tracking-lost-before-the-branch",
    "P03-drive-and-images-at-the-same-time-then-a-report",
    "P04-failure-of-a-task-ends-the-block-the-failure-of",
    "P05-floating-recharge-between-two-drives",
    "P06-a-wait-with-a-time-limit",
    "P07-one-arm-for-two-tasks",
    "P08-reference-to-a-node-that-does-not-exist",
    "draft3/P09-a-plan-sent-while-the-alternate-runs",
    "draft3/P10-a-held-block-is-given-a-child",
    "draft3/P11-an-alternate-that-was-stopped-may-run-again",
]


@pytest.mark.parametrize("path", OWN, ids=lambda p: p.stem)
def test_scenario_gives_the_trace_that_the_language_prescribes(path: Path) -> None:
    run = run_scenario(load_scenario(path))
    assert run.scenario.expect is not None
    assert not run.differences


@pytest.mark.parametrize("name", PUBLIC)
def test_public_scenario_agrees(name: str) -> None:
    run = run_scenario(load_scenario(shared(f"executive_scenarios/{name}.json")))
    assert not run.differences
