"""What a scientist and a flight director do on the page alone, from an empty service to three sols."""

from __future__ import annotations

import re
import time
from pathlib import Path

from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.page import pixel
from tests.web.review_steps import waive_all

PASSWORD = "a stone a day"
"""Of everybody here."""
FOUNDER, SCIENTIST, DIRECTOR = "Founder", "Ada Scientist", "Bo Director"
MISSION = "Two people"
SOLS = 3
"""Sols of a whole play."""
FIRST = ((4.0, 0.0, "Microscopic imager", 12), (-3.0, 3.0, "Microscopic imager", 9))
LATER = ((-3.0, -3.0, "Science camera", 4), (3.0, 5.0, "Science camera", 5))
"""What is asked on the first sol, and what is added on each later one: east, north, instrument, value."""
RUNS_MOST = 12
"""Dry runs draw another future each; one has to end well before the plan counts as verified."""


def token_of(server: Server) -> str:
    """Return the one-time token that the server wrote into its log, as whoever started it reads it."""
    end = time.monotonic() + 60.0
    while not (found := re.search(r"one-time token ([\w-]+)", (server.data / "server.log").read_text())):
        assert time.monotonic() < end, "the log holds no token"
        time.sleep(0.1)
    return found.group(1)


def found_service(page: Page, token: str) -> None:
    """Make the first administrator, then the accounts of the two people, and log out."""
    page.get_by_test_id("token").fill(token)
    page.get_by_role("textbox", name="Name", exact=True).fill(FOUNDER)
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Make the administrator").click()
    page.get_by_test_id("administer-people").click()
    people = page.get_by_role("dialog", name="People")
    for name, role in ((SCIENTIST, "planner"), (DIRECTOR, "flight director")):
        people.get_by_label("Name", exact=True).fill(name)
        people.get_by_label("Role", exact=True).select_option(role)
        people.get_by_label("First password").fill(PASSWORD)
        people.get_by_test_id("add-person").click()
        expect(people.get_by_role("cell", name=name, exact=True)).to_be_visible()
    page.keyboard.press("Escape")
    page.get_by_test_id("account").click()
    page.get_by_test_id("log-out").click()


def log_in(page: Page, name: str) -> None:
    expect(page.get_by_role("button", name="Log in", exact=True)).to_be_visible()  # it reads the page anew
    page.get_by_role("textbox", name="Name", exact=True).fill(name)
    page.get_by_label("Password").fill(PASSWORD)
    page.get_by_role("button", name="Log in", exact=True).click()
    expect(page.get_by_test_id("account")).to_contain_text(name)


def make_mission(page: Page) -> None:
    """Make a mission on ground from a seed."""
    page.get_by_role("button", name="New mission").click()
    page.get_by_label("Name", exact=True).fill(MISSION)
    page.get_by_role("spinbutton", name="Seed").fill("7")
    page.get_by_role("spinbutton", name="Side").fill("48")
    page.get_by_role("button", name="Open", exact=True).click()
    wait_for_map(page)


def open_mission(page: Page) -> None:
    page.get_by_role("link", name=MISSION).click()
    wait_for_map(page)


def wait_for_map(page: Page) -> None:
    page.wait_for_function("() => document.querySelector('[data-testid=map]')?.dataset.terrain")


def ask_for(page: Page, east: float, north: float, instrument: str, value: int) -> str:
    """Pick a target on the map and file a request on it; return the target's name."""
    rows = page.get_by_test_id("target-row")
    before = rows.count()
    page.keyboard.press("t")
    page.mouse.click(*pixel(page, east, north))
    page.get_by_role("radio", name=re.compile(instrument)).click()
    page.get_by_label("Value", exact=True).fill(str(value))
    page.get_by_test_id("save-request").click()
    expect(rows).to_have_count(before + 1)
    expect(page.get_by_test_id("save-request")).to_have_count(0)
    return page.get_by_label("Name of the target").input_value()


def set_budget(page: Page, hours: str) -> None:
    """Give the sol its hours and the search its seconds."""
    page.get_by_role("tab", name="Plan", exact=True).click()
    page.get_by_label("Time budget, h").fill(hours)
    page.get_by_label("Time budget, h").press("Tab")
    page.get_by_label("Time limit, s").fill("3")


def correct_start(page: Page) -> str:
    """Correct by two centimetres where the newest sol begins, as a localization would; return the text."""
    told = page.get_by_test_id("coordinates-text").inner_text()
    east, north, heading = (float(part) for part in told.split(","))
    wanted = f"{east + 0.02:.3f}, {north:.3f}, {heading:.1f}"
    page.get_by_role("button", name="Type start pose").click()
    page.get_by_label("start pose", exact=True).fill(wanted)
    page.get_by_label("start pose", exact=True).press("Enter")
    expect(page.get_by_test_id("coordinates-text")).to_have_text(wanted)
    return wanted


def plan_and_verify(page: Page) -> None:
    """Make a plan, rehearse it until a dry run ends well, and sign it as its author."""
    page.get_by_role("tab", name="Plan", exact=True).click()
    page.get_by_test_id("plan").click()
    expect(page.get_by_test_id("plan-state")).to_have_text("computed")
    expect(page.get_by_test_id("outline")).to_be_visible()
    page.get_by_role("tab", name="Run", exact=True).click()
    assert "succeeded" in (dry_run(page) for _ in range(RUNS_MOST)), "no dry run ended well"
    page.get_by_role("tab", name="Review").click()
    page.get_by_test_id("sign").click()
    expect(page.get_by_test_id("signatures")).to_contain_text(f"author {SCIENTIST}, verifier {SCIENTIST}")


def dry_run(page: Page) -> str:
    """Run the open plan once and return how it ended."""
    before = page.url
    page.get_by_test_id("start-run").click()
    page.wait_for_function("before => location.href !== before", arg=before)
    expect(page.get_by_test_id("start-run")).to_be_enabled()
    expect(page.get_by_test_id("run-outcome")).not_to_have_text(re.compile("queued|running"))
    return page.get_by_test_id("run-outcome").inner_text()


def approve_and_fly(page: Page, number: int, folder: Path) -> None:
    """Approve the plan of a sol, fetch its package, and let the training rover execute it."""
    page.get_by_test_id(f"sol-{number}").click()
    page.get_by_role("tab", name="Review").click()
    waive_all(page)
    page.get_by_label("Note of the approval").fill("Read and found good.")
    page.get_by_test_id("approve").click()
    expect(page.get_by_text("Approved by")).to_be_visible()
    with page.expect_download() as download:
        page.get_by_test_id("package").click()
    download.value.save_as(folder / f"sol-{number}.zip")
    expect(page.get_by_test_id(f"sol-{number}")).to_contain_text("uplinked")
    page.get_by_test_id("execute").click()
    expect(page.get_by_test_id(f"sol-{number}")).to_contain_text(re.compile(r"\d of \d done"))


def look_at_products(page: Page, names: list[str]) -> int:
    """Open what came back from its targets; return how many targets have a picture."""
    page.get_by_role("tab", name=re.compile("^Targets")).click()
    seen = 0
    for name in names:
        page.get_by_test_id("target-row").filter(has_text=name).first.click()
        expect(page.get_by_label("Name of the target")).to_have_value(name)
        products = page.get_by_test_id("target-products").get_by_test_id("product")
        if products.count() == 0:
            continue
        products.first.click()
        expect(page.get_by_test_id("product-image")).to_be_visible()
        page.wait_for_function("() => document.querySelector('[data-testid=product-image]').naturalWidth > 0")
        seen += 1
    return seen


def play(scientist: Page, director: Page, server: Server, folder: Path, *, sols: int = SOLS) -> None:
    """Play the founder's part, then one sol after the other; packages go into a folder.

    Both pages are open on a service that nobody has used. Each person sees by the stream alone what the other
    has done.
    """
    found_service(director, token_of(server))
    log_in(director, DIRECTOR)
    scientist.reload()  # it was open before there was anybody
    log_in(scientist, SCIENTIST)
    make_mission(scientist)
    names = [ask_for(scientist, *wanted) for wanted in FIRST]
    set_budget(scientist, "0.9")
    director.reload()
    open_mission(director)
    for number in range(1, sols + 1):
        plan_and_verify(scientist)
        approve_and_fly(director, number, folder)
        expect(scientist.get_by_test_id(f"sol-{number}")).to_contain_text(re.compile(r"\d of \d done"))
        assert look_at_products(scientist, names) >= 1, "no target has what was asked of it"
        if number == sols:
            break
        scientist.get_by_role("tab", name="Review").click()
        scientist.get_by_test_id("next-sol").click()
        opened = scientist.get_by_test_id(f"sol-{number + 1}")
        expect(opened).to_contain_text("no plan yet")
        expect(scientist.get_by_test_id(f"sol-{number + 1}")).to_contain_text("carried over")
        correct_start(scientist)
        names.append(ask_for(scientist, *LATER[number - 1]))
