"""The daemon goes and comes back; the page stays."""

from playwright.sync_api import expect

from browser.conftest import Open, Start
from browser.daemons import Daemon

RETURN_MS = 30_000


def test_the_page_survives_a_restart_of_the_daemon_without_being_loaded_anew(
    start_daemon: Start, open_page: Open
) -> None:
    daemon = start_daemon()
    watched = open_page(daemon.url)
    watched.expect_errors(
        "ERR_CONNECTION_REFUSED", "ERR_INCOMPLETE_CHUNKED", "ERR_EMPTY_RESPONSE", "WebSocket"
    )
    page = watched.page
    page.evaluate("window.still = true")
    page.get_by_label("Cow").fill("112")
    page.get_by_role("button", name="Start").wait_for()
    # What is fetched after the first panel is there: a module that is asked for meanwhile would not come.
    page.get_by_role("img", name="Picture").wait_for()
    page.locator(".curves[aria-label]").wait_for(state="attached")
    daemon.stop()
    expect(page.locator(".banner")).to_contain_text("No connection", timeout=RETURN_MS)
    expect(page.locator(".state")).to_have_attribute("data-state", "away")
    expect(page.get_by_role("button", name="Start")).to_be_disabled()
    expect(page.locator("#start-why")).to_contain_text("once the connection")
    expect(page.locator(".veil")).to_contain_text("this picture is old")
    daemon.start()
    expect(page.locator(".banner")).to_be_hidden(timeout=RETURN_MS)
    expect(page.locator(".state")).to_have_attribute("data-state", "ready", timeout=RETURN_MS)
    expect(page.get_by_role("button", name="Start")).to_be_enabled()
    expect(page.locator(".veil")).to_be_hidden(timeout=RETURN_MS)
    assert page.evaluate("window.still")
    assert page.get_by_label("Cow").input_value() == "112"


def test_two_tablets_see_the_same_and_either_may_stop(daemon: Daemon, open_page: Open) -> None:
    one, other = open_page(daemon.url).page, open_page(daemon.url).page
    one.get_by_role("radio", name="Until stopped").check()
    one.get_by_role("button", name="Start").click()
    expect(other.locator(".state")).to_have_attribute("data-state", "capturing")
    other.get_by_role("button", name="Stop").click()
    expect(one.locator(".state")).to_have_attribute("data-state", "ready")
    expect(one.locator(".last")).to_contain_text("Complete")
