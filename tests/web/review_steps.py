"""What two people do on the sheet Review until a plan may leave."""

from __future__ import annotations

import time

from playwright.sync_api import Page, expect
from playwright.sync_api import TimeoutError as PageTimeout


def become(page: Page, role: str) -> None:
    """Work on as the first person of a role."""
    people = page.get_by_test_id("person")
    people.select_option(people.locator("option", has_text=role).first.get_attribute("value"))


def sign_as_author(page: Page) -> None:
    """Sign the open plan as its maker; the maker does not approve."""
    page.get_by_role("tab", name="Review").click()
    expect(page.get_by_test_id("approve")).to_be_disabled()
    page.get_by_test_id("sign").click()
    expect(page.get_by_test_id("signatures")).to_contain_text("author Planner, verifier Planner")


def waive_all(page: Page) -> None:
    """Waive what does not hold of the open plan, until it can be approved."""
    button, waive = page.get_by_test_id("approve"), page.get_by_role("button", name="Waive…")
    number = 0
    end = time.monotonic() + 90.0
    while not button.is_enabled():
        assert time.monotonic() < end, "the plan cannot be approved, and nothing is left to waive"
        try:
            waive.first.click(timeout=1000.0)
        except PageTimeout:
            continue  # the rules are read anew for the second person: what was to be waived may hold by now
        number += 1
        page.get_by_label("Reason of the waiver").fill(f"Looked into, number {number}.")
        page.get_by_role("button", name="Waive", exact=True).click()
        expect(page.get_by_label("Reason of the waiver")).to_have_count(0)


def approve(page: Page) -> None:
    """Approve the open plan as the flight director, who waives what does not hold."""
    become(page, "flight director")
    waive_all(page)
    page.get_by_label("Note of the approval").fill("Read and found good.")
    page.get_by_test_id("approve").click()
    expect(page.get_by_text("Approved by")).to_be_visible()
