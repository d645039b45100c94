"""What two people do on the sheet Review until a plan may leave."""

from __future__ import annotations

from playwright.sync_api import Page, expect


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


def approve(page: Page) -> None:
    """Approve the open plan as the flight director, who waives what does not hold."""
    become(page, "flight director")
    # The rules are read anew for the second person, so what is to be waived may show a moment later.
    button, waive = page.get_by_test_id("approve"), page.get_by_role("button", name="Waive…")
    for rule in range(20):
        expect(page.locator("[data-testid=approve]:enabled").or_(waive).first).to_be_visible()
        if button.is_enabled():
            break
        waive.first.click()
        page.get_by_label("Reason of the waiver").fill(f"Looked into, number {rule + 1}.")
        page.get_by_role("button", name="Waive", exact=True).click()
        expect(page.get_by_label("Reason of the waiver")).to_have_count(0)
    page.get_by_label("Note of the approval").fill("Read and found good.")
    button.click()
    expect(page.get_by_text("Approved by")).to_be_visible()
