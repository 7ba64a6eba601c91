"""The live picture, and the aid for lamp and lens."""

from typing import Any

from playwright.sync_api import expect

from browser.conftest import Open
from browser.daemons import Daemon
from browser.pages import until

WHITE = """() => {
    const canvas = document.querySelector('.picture-canvas');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let white = 0;
    for (let i = 0; i < data.length; i += 4) white += data[i] > 200 && data[i + 1] > 200 && data[i + 2] > 200;
    return white;
}"""
PICTURE = "() => document.querySelector('.picture-canvas').toDataURL()"


def live(daemon: Daemon, open_page: Open, **options: object) -> Any:
    page = open_page(f"{daemon.url}/#live", **options).page
    until(page, f"() => ({WHITE})() > 500")
    return page


def changes(page: Any, before: str) -> None:
    until(page, f"(before) => ({PICTURE})() !== before", before)


def test_the_picture_shows_white_targets_and_goes_on(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    expect(page.locator(".viewfinder-counts")).to_contain_text("targets left")
    changes(page, page.evaluate(PICTURE))
    expect(page.locator(".veil")).to_be_hidden()


def test_a_frozen_picture_stays_until_it_is_let_go(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    page.get_by_role("button", name="Freeze").click()
    before = page.evaluate(PICTURE)
    page.wait_for_timeout(1500)
    assert page.evaluate(PICTURE) == before
    expect(page.locator(".veil")).to_be_hidden()
    page.get_by_role("button", name="Freeze").click()
    changes(page, before)


def test_ids_and_residuals_are_drawn_on_demand(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    page.get_by_role("button", name="Freeze").click()
    for name in ("Numbers", "Residuals"):
        before = page.evaluate(PICTURE)
        page.get_by_role("button", name=name).click()
        changes(page, before)
    expect(page.get_by_text("to 0.15 px")).to_be_visible()


def test_each_view_says_how_many_targets_it_shows_and_how_large(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    for view in ("left", "right"):
        facts = page.locator(f'[data-view="{view}"]')
        expect(facts).to_contain_text("px")
        assert int(facts.locator("dd").first.inner_text()) > 20


def test_a_threshold_set_by_hand_is_in_force_until_it_is_chosen_by_itself_again(
    daemon: Daemon, open_page: Open
) -> None:
    page = live(daemon, open_page)
    expect(page.get_by_label("Chosen by itself")).to_be_checked()
    page.get_by_label("Threshold").fill("120")
    until(page, "() => document.querySelector('.aid output').textContent === '120'")
    expect(page.get_by_label("Chosen by itself")).not_to_be_checked()
    _until(page, daemon, "fixed")
    page.get_by_label("Chosen by itself").check()
    _until(page, daemon, "automatic")


def _until(page: Any, daemon: Daemon, kind: str) -> None:
    for _ in range(100):
        if daemon.ask("/settings")["devices"]["simulated"]["threshold"]["kind"] == kind:
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"the threshold is not {kind}")
