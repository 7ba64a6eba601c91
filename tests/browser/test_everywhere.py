"""What holds for every panel: accessible, nothing cut off, nothing from elsewhere, in both languages."""

from typing import Any

import pytest

from browser.axe import serious
from browser.conftest import PHONE, TABLET, Open
from browser.daemons import Daemon

PANELS = ["operate", "live", "shape", "plots", "captures", "compare", "calibration", "calibration/place"]
SMALLEST_PX = 44
"""WCAG 2.5.5; links inside sentences are as high as their line."""

CUT_OFF = """() => [...document.querySelectorAll('main *')]
    .filter((one) => one.checkVisibility() && !one.closest('.scroll, .visually-hidden, svg, canvas'))
    .filter((one) => {
        const box = one.getBoundingClientRect();
        return box.width > 1 && (box.right > innerWidth + 1 || box.left < -1);
    })
    .map((one) => `${one.tagName} ${one.className} ${one.textContent.slice(0, 40)}`)"""
TOO_SMALL = """(least) => [...document.querySelectorAll('button, select, summary, .button, .choices label')]
    .filter((one) => one.checkVisibility() && !one.classList.contains('skip'))
    .filter((one) => one.getBoundingClientRect().height > 0)
    .filter((one) => one.getBoundingClientRect().height < least)
    .map((one) => `${one.tagName} ${one.className} ${one.textContent.slice(0, 40)}`)"""


def at(daemon: Daemon, panel: str) -> str:
    return f"{daemon.url}/#{panel}"


@pytest.mark.parametrize("look", ["light", "dark"])
@pytest.mark.parametrize("panel", PANELS)
def test_axe_finds_nothing_serious(daemon: Daemon, open_page: Open, panel: str, look: str) -> None:
    page = open_page(at(daemon, panel), look=look).page
    assert serious(page) == []


@pytest.mark.parametrize("size", [TABLET, PHONE], ids=["tablet", "phone"])
@pytest.mark.parametrize("panel", PANELS)
def test_nothing_is_cut_off_or_too_small_to_touch(
    daemon: Daemon, open_page: Open, panel: str, size: dict[str, int]
) -> None:
    page = open_page(at(daemon, panel), size=size, language="nb").page
    assert page.evaluate(CUT_OFF) == []
    assert page.evaluate(TOO_SMALL, SMALLEST_PX) == []


def test_the_language_is_the_browsers_until_another_is_chosen(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url, language="nb-NO").page
    assert page.locator("h1").first.inner_text() == "Klar"
    page.get_by_label("Meny").click()
    page.get_by_label("Språk").select_option("en")
    page.get_by_role("heading", name="Ready").wait_for()
    page.reload()
    page.get_by_role("heading", name="Ready").wait_for()


def test_light_or_dark_is_the_tablets_until_it_is_chosen(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url, look="light").page
    light = _ground(page)
    page.get_by_label("Menu").click()
    page.get_by_label("Appearance").select_option("dark")
    assert _ground(page) != light
    page.reload()
    page.wait_for_selector("[data-panel]")
    assert _ground(page) != light


def test_the_first_paint_has_the_state_before_anything_else_has_been_asked_for(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(daemon.url).page
    page.route("**/api/v1/**", lambda _: None)  # is never answered
    page.reload()
    page.get_by_role("heading", name="Ready").wait_for()
    paint_ms = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0].startTime")
    assert paint_ms < 5000  # far more than half a second on a computer that does other work as well


def test_the_keyboard_reaches_start_by_the_way_of_the_page(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    seen: list[str] = []
    for _ in range(12):
        page.keyboard.press("Tab")
        seen.append(page.evaluate("document.activeElement.dataset.do ?? document.activeElement.textContent"))
    assert seen[0] == "Skip to the content"
    assert "start" in seen


def _ground(page: Any) -> str:
    colour: str = page.evaluate("getComputedStyle(document.body).backgroundColor")
    return colour
