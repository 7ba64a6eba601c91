"""The liner in space: live, and in a capture."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from browser.axe import serious
from browser.conftest import PHONE, Open, Start
from browser.daemons import Daemon
from browser.pages import until

COUNT_FRAMES = """() => {
  const ask = window.requestAnimationFrame;
  window.frames_asked = 0;
  window.requestAnimationFrame = (draw) => { window.frames_asked += 1; return ask(draw); };
}"""
NO_WEBGL = """
  const get = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : get.call(this, kind, ...rest);
  };
"""


@pytest.fixture(scope="module")
def capture(daemon: Daemon) -> str:
    """Id of a capture of one pulsation."""
    return daemon.capture(fields=50, labels={"cow": "112"})


def summary(page: Page) -> str:
    return page.locator("#scene-summary").inner_text()


def drawn(page: Page, folder: Path) -> np.ndarray:
    """The pixels of the picture that are not of its ground."""
    file = folder / "canvas.png"
    page.locator(".scene-canvas").screenshot(path=file)
    picture = cv2.imread(str(file)).astype(int)
    inside = picture[20:-20, 20:-20]
    return inside[np.abs(inside - inside[0, 0]).max(axis=2) > 60]


def colourful(pixels: np.ndarray) -> int:
    return int((np.ptp(pixels, axis=1) > 90).sum())


def colours_at(page: Page, slider: Locator, field: int, folder: Path) -> int:
    """Of a field, once it is drawn; near its nominal place the wall has the scale's dark end."""
    slider.fill(str(field))
    page.wait_for_timeout(500)
    return colourful(drawn(page, folder))


def opened(open_page: Open, url: str, **options: object) -> Page:
    page: Page = open_page(url, **options).page
    page.wait_for_selector("#scene-summary:not(:empty)")
    return page


def eventually(page: Page, condition: Callable[[], bool]) -> None:
    """A picture may be drawn a little later than what stands beside it."""
    for _ in range(100):
        if condition():
            return
        page.wait_for_timeout(200)
    raise AssertionError("the picture does not become what it should be")


def test_live_it_follows_the_newest_field(daemon: Daemon, open_page: Open, tmp_path: Path) -> None:
    page = opened(open_page, f"{daemon.url}/#shape")
    expect(page.locator(".badge").first).to_have_text("Live")
    first = summary(page)
    assert "of 108 targets of liner" in first
    until(page, "before => document.getElementById('scene-summary').textContent !== before", first)
    assert len(drawn(page, tmp_path)) > 2000


def test_a_capture_is_played_and_paused_and_gone_through(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}")
    slider = page.get_by_role("slider", name="Moment")
    assert slider.input_value() == "0"
    page.get_by_role("button", name="Play").click()
    until(page, "() => document.querySelector('.scene-player .slider').value > 3")
    page.get_by_role("button", name="Pause").click()
    slider.fill("25")
    expect(page.locator(".scene-when")).to_have_text("Field 25, 0.50 s")
    assert "Field 25, 0.50 s." in summary(page)


def test_colours_stand_for_what_is_chosen(
    daemon: Daemon, capture: str, open_page: Open, tmp_path: Path
) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}")
    expect(page.locator(".scene-legend-title")).to_have_text("Displacement from nominal, mm")
    slider = page.get_by_role("slider", name="Moment")
    coloured = max(colours_at(page, slider, moment, tmp_path) for moment in (0, 12, 25, 37))
    assert coloured > 0
    page.get_by_label("Coloured by").select_option("plain")
    expect(page.locator(".scene-legend")).to_be_hidden()
    eventually(page, lambda: colourful(drawn(page, tmp_path)) < coloured / 5)


def test_it_is_seen_from_the_sides_and_turned_by_keys(daemon: Daemon, capture: str, open_page: Open) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}")
    for name, words in {"Front": "the front", "Side": "the side", "Top": "the top"}.items():
        page.get_by_role("button", name=name, exact=True).click()
        expect(page.get_by_role("button", name=name, exact=True)).to_have_attribute("aria-pressed", "true")
        assert f"Seen from {words}." in summary(page)
    page.locator(".scene-canvas").press("ArrowLeft")
    assert "Seen from where you turned it." in summary(page)
    expect(page.get_by_role("button", name="Top", exact=True)).to_have_attribute("aria-pressed", "false")


def test_both_cameras_can_be_shown(daemon: Daemon, capture: str, open_page: Open) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}")
    expect(page.locator(".scene-camera")).to_have_count(0)
    page.get_by_label("Cameras").check()
    expect(page.locator(".scene-camera")).to_have_text(["Left camera", "Right camera"])


def test_the_view_is_saved_as_a_picture(
    daemon: Daemon, capture: str, open_page: Open, tmp_path: Path
) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}")
    with page.expect_download() as download:
        page.get_by_role("button", name="Save as picture").click()
    assert download.value.suggested_filename == f"{capture}-0.png"
    download.value.save_as(tmp_path / "view.png")
    picture = cv2.imread(str(tmp_path / "view.png"))
    assert picture.shape[0] > picture.shape[1] / 2 > 200
    assert (picture.max(axis=2).astype(int) - picture.min(axis=2) > 60).sum() > 5000


def test_a_touched_target_is_shown_in_numbers_and_leads_to_its_curves(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}", size=PHONE)
    box = page.locator(".scene-canvas").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    target = page.locator("#scene-target").input_value()
    expect(page.locator(".scene-inspector dt").first).to_have_text("X")
    page.get_by_role("link", name="Over time").last.click()
    expect(page.locator("#target")).to_have_value(target)


def test_nothing_is_drawn_while_nothing_changes(daemon: Daemon, capture: str, open_page: Open) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}")
    page.wait_for_timeout(500)
    page.evaluate(COUNT_FRAMES)
    page.wait_for_timeout(1500)
    assert page.evaluate("window.frames_asked") == 0
    page.get_by_role("button", name="Front").click()
    assert page.evaluate("window.frames_asked") == 1


def test_without_webgl_it_says_so_and_tells_what_is_there(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = open_page(f"{daemon.url}/#operate").page
    page.context.add_init_script(NO_WEBGL)
    page.goto(f"{daemon.url}/#shape/{capture}")
    page.reload()
    expect(page.locator(".note.is-warn")).to_contain_text("WebGL 2 is missing")
    assert "of 108 targets" in summary(page)


def test_it_can_be_used_without_seeing_it(daemon: Daemon, capture: str, open_page: Open) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}", look="dark", language="nb")
    assert serious(page) == []


def test_on_a_phone_it_has_room(daemon: Daemon, capture: str, open_page: Open) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{capture}", size=PHONE, language="nb")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.locator(".scene-canvas").bounding_box()["height"] > 250


def test_a_long_capture_is_played_part_by_part(daemon: Daemon, open_page: Open) -> None:
    page = opened(open_page, f"{daemon.url}/#shape/{daemon.capture(fields=260)}")
    part = page.get_by_label("2 parts of five seconds")
    part.fill("2")
    part.dispatch_event("change")
    expect(page.locator(".scene-when")).to_have_text("Field 250, 5.00 s")


def test_where_no_target_was_seen_it_says_so(open_page: Open, start_daemon: Start) -> None:
    other = start_daemon(scene="blank")
    page = opened(open_page, f"{other.url}/#shape/{other.capture(fields=10)}")
    assert summary(page).startswith("0 of 108 targets of liner.")
