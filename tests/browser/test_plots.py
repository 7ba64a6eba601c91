"""Curves over the last minutes."""

import csv
import itertools
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from browser.axe import serious
from browser.conftest import PHONE, Open
from browser.daemons import Daemon
from browser.pages import spread, touch

LIVE = ["Targets", "Residual in the picture px", "From field to points ms", "Width of the section mm"]


def saved(page: Page, folder: Path) -> list[dict[str, str]]:
    """The rows of the CSV file that the page gives."""
    with page.expect_download() as download:
        page.get_by_role("button", name="Save as CSV").click()
    file = folder / download.value.suggested_filename
    download.value.save_as(file)
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


def test_a_page_that_is_opened_late_has_the_minutes_before_with_every_field(
    daemon: Daemon, open_page: Open, tmp_path: Path
) -> None:
    """The daemon keeps them: the capture was taken before there was a page."""
    daemon.wait_until_sealed(daemon.capture())
    page = open_page(f"{daemon.url}/#plots").page
    expect(page.locator(".chart h2")).to_have_text(LIVE)
    expect(page.locator(".chart canvas")).to_have_count(4)
    rows = saved(page, tmp_path)
    times = [float(row["time_unix_s"]) for row in rows]
    assert times[-1] - times[0] > 0.9
    steps = [b - a for a, b in itertools.pairwise(times)]
    assert sorted(steps)[len(steps) // 2] == pytest.approx(0.02, abs=0.002)
    found = [row for row in rows if row["points"]]
    assert all(60 < int(row["points"]) <= int(row["targets_left"]) for row in found)
    widths = [float(row["section_width_mm"]) for row in found if row["section_width_mm"]]
    assert len(widths) > len(found) / 2
    assert 15 < min(widths) <= max(widths) < 35


def test_they_go_on_by_themselves(daemon: Daemon, open_page: Open, tmp_path: Path) -> None:
    page = open_page(f"{daemon.url}/#plots").page
    expect(page.locator(".chart canvas")).to_have_count(4)
    while not (rows := saved(page, tmp_path)):
        page.wait_for_timeout(100)  # a busy computer draws the charts before its first field is measured
    before = float(rows[-1]["time_unix_s"])
    page.wait_for_timeout(1500)
    assert float(saved(page, tmp_path)[-1]["time_unix_s"]) > before


def test_two_fingers_zoom_every_chart_and_a_double_tap_shows_all(daemon: Daemon, open_page: Open) -> None:
    daemon.wait_until_sealed(daemon.capture())
    page = open_page(f"{daemon.url}/#plots", size=PHONE).page
    expect(page.locator(".chart canvas")).to_have_count(4)
    place = page.locator(".chart-place").first
    spread(page, place)
    whole = page.get_by_role("button", name="Show all")
    expect(whole.first).to_be_visible()
    expect(whole.last).to_be_visible()
    box = place.bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    for _ in range(2):
        touch(page, (middle, middle), steps=1)
    expect(whole.first).to_be_hidden()


def test_charts_are_told_in_words_and_numbers_too(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#plots", size=PHONE).page
    chart = page.get_by_role("img", name="Targets Left view: last")
    expect(chart).to_be_visible()
    page.get_by_text("As numbers").click()
    rows = page.locator("details tbody tr")
    expect(rows).to_have_count(6)
    expect(rows.first.locator("th")).to_have_text("Left view")
    expect(rows.first.locator("td").first).not_to_have_text("–")


def test_how_far_back_is_remembered(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#plots").page
    page.get_by_role("radio", name="5 min").check()
    page.reload()
    expect(page.get_by_role("radio", name="5 min")).to_be_checked()


def test_they_are_drawn_in_colours_of_the_light_and_of_the_dark(daemon: Daemon, open_page: Open) -> None:
    for look in ("light", "dark"):
        page = open_page(f"{daemon.url}/#plots", look=look).page
        expect(page.locator(".chart canvas")).to_have_count(4)
        assert serious(page) == []
