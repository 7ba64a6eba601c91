"""Curves: the last minutes live, a target of a capture."""

import csv
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from browser.axe import serious
from browser.conftest import PHONE, Open
from browser.daemons import Daemon

LIVE = ["Targets", "Residual in the picture px", "From field to points ms", "Width of the section mm"]


@pytest.fixture(scope="module")
def capture(daemon: Daemon) -> str:
    """Id of a capture of one pulsation."""
    return daemon.capture(fields=50, labels={"cow": "112"})


def saved(page: Page, folder: Path) -> list[dict[str, str]]:
    """The rows of the CSV file that the page gives."""
    with page.expect_download() as download:
        page.get_by_role("button", name="Save as CSV").click()
    file = folder / download.value.suggested_filename
    download.value.save_as(file)
    with file.open(newline="") as lines:
        return list(csv.DictReader(lines))


def test_what_happened_before_the_plots_were_opened_is_in_them(
    daemon: Daemon, open_page: Open, tmp_path: Path
) -> None:
    page = open_page(f"{daemon.url}/#operate").page
    page.wait_for_timeout(3000)
    page.evaluate("location.hash = 'plots'")
    expect(page.locator(".chart h2")).to_have_text(LIVE)
    rows = saved(page, tmp_path)
    times = [float(row["time_unix_s"]) for row in rows]
    assert times[-1] - times[0] > 1.5
    assert all(60 < int(row["points"]) <= int(row["targets_left"]) for row in rows[1:] if row["points"])
    widths = [float(row["section_width_mm"]) for row in rows if row["section_width_mm"]]
    assert len(widths) > len(rows) / 2
    assert 15 < min(widths) <= max(widths) < 35


def test_they_go_on_while_another_panel_is_shown(daemon: Daemon, open_page: Open, tmp_path: Path) -> None:
    page = open_page(f"{daemon.url}/#plots").page
    before = len(saved(page, tmp_path))
    page.evaluate("location.hash = 'operate'")
    expect(page.locator("[data-panel=operate]")).to_be_visible()
    page.wait_for_timeout(2500)
    page.evaluate("location.hash = 'plots'")
    assert len(saved(page, tmp_path)) > before + 3


def test_charts_are_told_in_words_and_numbers_too(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#plots", size=PHONE).page
    chart = page.get_by_role("img", name="Targets Left view: last")
    expect(chart).to_be_visible()
    page.get_by_text("In numbers").click()
    rows = page.locator("details tbody tr")
    expect(rows).to_have_count(7)
    expect(rows.first.locator("th")).to_have_text("Left view")
    expect(rows.first.locator("td").first).not_to_have_text("–")


def test_how_far_back_is_remembered(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#plots").page
    page.get_by_role("radio", name="5 min").check()
    page.reload()
    expect(page.get_by_role("radio", name="5 min")).to_be_checked()


def test_a_target_of_a_capture_has_its_curves_with_sigma(
    daemon: Daemon, capture: str, open_page: Open, tmp_path: Path
) -> None:
    page = open_page(f"{daemon.url}/#plots/{capture}").page
    expect(page.locator(".chart h2")).to_have_text([f"{axis} of the target mm" for axis in "XYZ"])
    expect(page.get_by_role("status").first).to_contain_text("measured in 50 of 50 fields")
    rows = saved(page, tmp_path)
    assert [int(row["n"]) for row in rows] == list(range(50))
    assert all(0 < float(row["sigma_z_mm"]) < 0.5 for row in rows)
    depths = [float(row["z_mm"]) for row in rows]
    assert max(depths) - min(depths) > 2


def test_another_target_is_chosen_from_the_list_or_stepped_to(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = open_page(f"{daemon.url}/#plots/{capture}/8").page
    target = page.get_by_label("Target", exact=True)
    expect(target).to_have_value("8")
    page.get_by_role("button", name="The next target").click()
    expect(target).to_have_value("9")
    expect(page.get_by_role("status").first).to_contain_text("Target 9 was measured")
    target.select_option("1")
    expect(page.get_by_role("status").first).to_contain_text("Target 1 was measured in 0 of 50 fields")


def test_they_are_drawn_in_colours_of_the_light_and_of_the_dark(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    for look in ("light", "dark"):
        page = open_page(f"{daemon.url}/#plots/{capture}", look=look).page
        expect(page.locator(".chart canvas")).to_have_count(3)
        assert serious(page) == []
