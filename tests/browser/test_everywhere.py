"""What holds for every panel: accessible, nothing cut off, nothing from elsewhere, in both languages."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Page

from browser.axe import serious
from browser.conftest import CHEAP, TABLET, Open
from browser.daemons import Daemon

PANELS = [
    "operate",
    "live",
    "shape",
    "plots",
    "captures",
    "compare",
    "profiles",
    "profiles/liner",
    "tests",
    "tests/reference",
    "tests/artificial-teat",
    "calibration",
    "calibration/place",
]
LOOKED_AGAIN_MS = 1500
"""Within which every panel has asked again for what it follows, by its own clock."""
ANSWERED_MS = 200
IDS = {
    "calibration/place": "calibration-step",
    "profiles/liner": "profiles-new",
    "tests/reference": "tests-of",
    "tests/artificial-teat": "tests-of",
}
SMALLEST_PX = 44
"""WCAG 2.5.5; links inside sentences are as high as their line."""

CUT_OFF = """() => [...document.querySelectorAll('main *')]
    .filter((one) => one.checkVisibility() && !one.closest('.scroll, .visually-hidden, svg, canvas'))
    .filter((one) => {
        const box = one.getBoundingClientRect();
        return box.width > 1 && (box.right > innerWidth + 1 || box.left < -1);
    })
    .map((one) => `${one.tagName} ${one.className} ${one.textContent.slice(0, 40)}`)"""
OUT_OF_PLACE = """() => [
    ...(document.scrollingElement.scrollWidth > innerWidth ? ['the page scrolls sideways'] : []),
    ...[...document.querySelectorAll('.nav-link')].filter((link) => {
        const [word, room] = [link.lastElementChild.getBoundingClientRect(), link.getBoundingClientRect()];
        return word.left < room.left || word.right > room.right || room.right > innerWidth;
    }).map((link) => link.textContent),
    ...[...document.querySelectorAll('main *')]
        .filter((one) => one.checkVisibility() && !one.closest('.scroll, .visually-hidden, svg, .picture'))
        .filter((one) => ['hidden', 'clip'].includes(getComputedStyle(one).overflowX))
        .filter((one) => one.clientWidth > 1 && one.scrollWidth > one.clientWidth + 1)
        .map((one) => `${one.tagName} ${one.className} ${one.textContent.slice(0, 40)}`),
]"""
SIZES = {
    "a small phone": {"width": 320, "height": 640},
    "a phone": {"width": 360, "height": 740},
    "a tablet on its side": TABLET,
    "a screen": {"width": 1920, "height": 1080},
}
WIDEST_LEGEND = """async () => {
    const root = document.querySelector('script[type=module]').src.replace(/main[.]js$/, '');
    const { createLegend } = await import(root + 'scene/legend.js');
    const number = (value, digits) => value.toLocaleString('nb', { minimumFractionDigits: digits });
    const legend = createLegend(number);
    document.querySelector('.scene-legend').replaceWith(legend.element);
    legend.show('Trykk mot spenen, kPa', { low: -1000, high: 1000, map: 'signed' });
    return legend.element.lastElementChild.lastElementChild.textContent;
}"""
STAGE_BEFORE_ITS_SIZE = """async () => {
    const root = document.querySelector('script[type=module]').src.replace(/main[.]js$/, '');
    const { createStage } = await import(root + 'scene/stage.js');
    const picture = document.querySelector('.scene-picture');
    const canvas = Object.assign(document.createElement('canvas'), { className: 'scene-canvas' });
    picture.replaceChildren(canvas);
    createStage(canvas, { cells: [], edges: [], target: [] });
    const widths = [canvas.offsetWidth, picture.clientWidth];
    picture.style.inlineSize = '200px';
    return [...widths, canvas.offsetWidth, picture.clientWidth];
}"""
TOO_SMALL = """(least) => [...document.querySelectorAll('button, select, summary, .button, .choices label')]
    .filter((one) => one.checkVisibility() && !one.classList.contains('skip'))
    .filter((one) => one.getBoundingClientRect().height > 0)
    .filter((one) => one.getBoundingClientRect().height < least)
    .map((one) => `${one.tagName} ${one.className} ${one.textContent.slice(0, 40)}`)"""


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """One of its own: what the panels show must not depend on the tests that were run before."""
    with Daemon(tmp_path_factory.mktemp("daemon"), location=CHEAP) as one:
        one.wait_until_it_streams()
        yield one


def at(daemon: Daemon, panel: str) -> str:
    return f"{daemon.url}/#{panel}"


def every_panel(page: Page, daemon: Daemon) -> Iterator[str]:
    """Goes through the panels in one page: it is its loading that costs most."""
    for panel in PANELS:
        page.goto(at(daemon, panel))
        page.wait_for_selector(f"[data-panel={IDS.get(panel, panel)}]")
        yield panel


@pytest.mark.parametrize("look", ["light", "dark"])
def test_axe_finds_nothing_serious(daemon: Daemon, open_page: Open, look: str) -> None:
    page = open_page(at(daemon, PANELS[0]), look=look).page
    for panel in every_panel(page, daemon):
        assert (panel, serious(page)) == (panel, [])


@pytest.mark.parametrize("size", SIZES.values(), ids=SIZES)
def test_every_panel_fits_from_a_small_phone_to_a_screen_and_can_be_touched(
    daemon: Daemon, open_page: Open, size: dict[str, int]
) -> None:
    page = open_page(at(daemon, PANELS[0]), size=size, language="nb").page
    for panel in every_panel(page, daemon):
        wrong = page.evaluate(CUT_OFF) + page.evaluate(OUT_OF_PLACE) + page.evaluate(TOO_SMALL, SMALLEST_PX)
        assert (panel, wrong) == (panel, [])


def test_the_legend_fits_a_small_phone_with_a_long_number_at_its_very_end(
    daemon: Daemon, open_page: Open
) -> None:
    """Which number stands there, and how near the end, follows what has been measured so far."""
    size = SIZES["a small phone"]
    page = open_page(at(daemon, "shape"), size=size, language="nb", ready=".scene-legend-marks > span").page
    assert len(page.evaluate(WIDEST_LEGEND)) == len("1 000")
    assert page.evaluate(OUT_OF_PLACE) == []


def test_the_canvas_is_as_wide_as_its_place_before_it_was_told_so(daemon: Daemon, open_page: Open) -> None:
    """An observer tells its size after the first layout: until then nothing may stand out either."""
    size = SIZES["a small phone"]
    page = open_page(at(daemon, "shape"), size=size, language="nb", ready=".scene-picture").page
    canvas, place, canvas_after, place_after = page.evaluate(STAGE_BEFORE_ITS_SIZE)
    assert (canvas, canvas_after) == (place, place_after)


def test_nothing_is_asked_of_a_device_that_is_not_there(unplugged: Daemon, open_page: Open) -> None:
    page = open_page(at(unplugged, PANELS[0])).page
    page.clock.install()
    for _ in every_panel(page, unplugged):
        page.clock.run_for(LOOKED_AGAIN_MS)
        page.wait_for_timeout(ANSWERED_MS)


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
