"""The liner in space."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from browser.axe import serious
from browser.conftest import PHONE, Open
from browser.daemons import Daemon
from browser.pages import until

TALL = {"width": 1440, "height": 1600}
"""Nothing of the room lies over anything else."""


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
    page.wait_for_selector("#scene-summary:not(:empty)", state="attached")
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


def test_colours_stand_for_what_is_chosen_and_are_saved_with_their_legend(
    daemon: Daemon, capture: str, open_page: Open, tmp_path: Path
) -> None:
    page = opened(open_page, f"{daemon.url}/#replay/{capture}", size=TALL)
    expect(page.locator(".scene-legend-title").first).to_have_text("Displacement from nominal, mm")
    slider = page.get_by_role("slider", name="Which field")
    coloured = max(colours_at(page, slider, moment, tmp_path) for moment in (0, 12, 25, 37))
    assert coloured > 0
    page.get_by_text("Turn, colour, choose").click()
    with page.expect_download() as download:
        page.get_by_role("button", name="Save as picture").click()
    assert download.value.suggested_filename == f"{capture}-37.png"
    download.value.save_as(tmp_path / "view.png")
    picture = cv2.imread(str(tmp_path / "view.png"))
    assert (picture.max(axis=2).astype(int) - picture.min(axis=2) > 60).sum() > 5000
    page.get_by_label("Coloured by").select_option("plain")
    expect(page.locator(".scene-legend").first).to_be_hidden()
    eventually(page, lambda: colourful(drawn(page, tmp_path)) < coloured / 5)


def test_it_is_seen_from_the_sides_turned_by_keys_and_shows_both_cameras(
    daemon: Daemon, open_page: Open
) -> None:
    page = opened(open_page, f"{daemon.url}/#shape")
    for name, words in {"Front": "the front", "Side": "the side", "Top": "the top"}.items():
        page.get_by_role("button", name=name, exact=True).click()
        expect(page.get_by_role("button", name=name, exact=True)).to_have_attribute("aria-pressed", "true")
        assert f"Seen from {words}." in summary(page)
    page.locator(".scene-canvas").press("ArrowLeft")
    assert "Seen from your own angle." in summary(page)
    expect(page.get_by_role("button", name="Top", exact=True)).to_have_attribute("aria-pressed", "false")
    expect(page.locator(".scene-camera")).to_have_count(0)
    page.get_by_label("Cameras").check()
    expect(page.locator(".scene-camera")).to_have_text(["Left camera", "Right camera"])


def test_a_touched_target_is_shown_in_numbers_and_is_that_of_the_curves(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = opened(open_page, f"{daemon.url}/#replay/{capture}")
    page.get_by_label("Which curve").select_option("x")
    page.get_by_text("Turn, colour, choose").click()
    box = page.locator(".scene-canvas").bounding_box()
    page.locator(".scene-canvas").click(position={"x": box["width"] / 2, "y": box["height"] / 2})
    expect(page.locator(".scene-inspector dt").first).to_have_text("X")
    target = page.locator("#scene-target").input_value()
    expect(page.locator("#target")).to_have_value(target)


def test_it_can_be_used_without_seeing_it(daemon: Daemon, open_page: Open) -> None:
    page = opened(open_page, f"{daemon.url}/#shape", look="dark", language="nb")
    assert serious(page) == []


def test_on_a_phone_it_has_room(daemon: Daemon, open_page: Open) -> None:
    page = opened(open_page, f"{daemon.url}/#shape", size=PHONE, language="nb")
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.locator(".scene-canvas").bounding_box()["height"] > 250
