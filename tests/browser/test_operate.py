"""The operator's panel: state, Start and Stop."""

from playwright.sync_api import Page, expect

from browser.conftest import Open
from browser.daemons import Daemon


def length(page: Page, name: str) -> None:
    page.get_by_role("radio", name=name).check()


def is_in_state(page: Page, state: str) -> None:
    expect(page.locator(".state")).to_have_attribute("data-state", state)


def test_the_state_is_a_word_with_a_symbol_and_since_when(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    is_in_state(page, "ready")
    expect(page.locator(".state h1")).to_have_text("Ready")
    expect(page.locator(".state-since")).to_contain_text("since")
    assert str(page.locator(".state > svg use").get_attribute("href")).endswith("#ready")


def test_from_start_to_stop(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Until stopped")
    page.get_by_label("Cow").fill("112")
    page.get_by_role("button", name="Start").click()
    is_in_state(page, "capturing")
    page.get_by_role("button", name="Stop").click()
    is_in_state(page, "ready")
    expect(page.locator(".last")).to_contain_text("Complete")
    newest = daemon.ask("/captures?limit=1")["captures"][0]
    assert newest["labels"] == {"cow": "112"}
    assert daemon.wait_until_sealed(newest["id"])["verdict"] == "complete"


def test_a_double_tap_starts_one_capture(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    before = len(daemon.ask("/captures")["captures"])
    length(page, "Fields")
    page.get_by_label("How many").fill("26")  # as no capture before it had
    page.get_by_role("button", name="Start").dblclick()
    expect(page.locator(".last")).to_contain_text("26 fields")
    expect(page.locator(".last")).to_contain_text("Complete")
    assert len(daemon.ask("/captures")["captures"]) == before + 1
    expect(page.locator(".toast.bad")).to_have_count(0)


def test_a_length_in_pulsations_is_shown_in_fields(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Pulsations")
    page.get_by_label("How many").fill("3")
    page.get_by_label("Pulsations a minute").fill("60")
    expect(page.locator("#length-is")).to_have_text("= 3.00 s, 150 fields")


def test_armed_first_then_triggered(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Fields")
    page.get_by_label("How many").fill("20")
    page.get_by_label("Wait for a second press").check()
    page.get_by_label("Before the start").fill("10")
    page.get_by_role("button", name="Arm").click()
    is_in_state(page, "armed")
    page.get_by_role("button", name="Start now").click()
    expect(page.locator(".last")).to_contain_text("30 fields")
    expect(page.locator(".last")).to_contain_text("Complete")


def test_no_length_is_no_order(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Seconds")
    page.get_by_label("How many").fill("")
    expect(page.get_by_role("button", name="Start")).to_be_disabled()
    expect(page.locator("#start-why")).to_have_text("Check the length below.")
