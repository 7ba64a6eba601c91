"""Analyses asked for with one press and looked at; captures compared."""

import csv
import json
import math
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from playwright.sync_api import Locator, Page, expect

from browser.axe import serious
from browser.conftest import Open
from browser.daemons import Daemon

PATIENCE_MS = 200_000
FIELDS = 12
"""Too few for a cycle, enough for strain field by field."""
CYCLES = 110
"""Two of them, and a little."""


def fill_in(page: Page, **numbers: str) -> None:
    for name, value in numbers.items():
        page.locator(f"[data-asked='material.{name}']").fill(value)


def stroke(daemon: Daemon, capture: str) -> re.Pattern[str]:
    """As the analysis has it, to whatever digit it is shown."""
    record = daemon.ask(f"/captures/{capture}/analyses")["analyses"][0]
    (found,) = [one for one in record["quantities"] if one["name"] == "stroke_mm"]
    cut = math.floor(10 * found["value"]) / 10
    return re.compile(rf"^{cut:.1f}\d+ ± 0\.\d+ mm$")


def test_what_is_known_is_there_what_lacks_is_told_and_nothing_typed_is_lost(
    daemon: Daemon, open_page: Open
) -> None:
    capture = daemon.capture(5, labels={"liner": "unheard of", "cow": "9"})
    page = open_page(f"{daemon.url}/#analysis/{capture}").page
    expect(page.get_by_role("button", name="Analyse")).to_be_enabled()
    expect(page.locator("[data-lack='liner_profile']")).to_contain_text("Liner “unheard of” has no profile")
    expect(page.locator("[data-lack='material'] a")).to_have_text("Take a ramp with the empty liner.")
    expect(page.locator("[data-lack='vacuum_pulsation']")).to_contain_text("shape and stroke only")
    page.get_by_text("Change a value for this analysis").click()
    page.get_by_label("Material law").select_option("linear")
    expect(page.locator("#analysis-why")).to_contain_text("Stiffness E")
    expect(page.get_by_role("button", name="Analyse")).to_be_disabled()
    fill_in(page, E_mpa="3", wall_mm="-2", poisson="0.7", F0_n="60", radius_mm="12.5", target_mm="0")
    refused = page.locator("[data-refused]")
    expect(refused).to_contain_text("wall_mm")
    expect(refused).to_contain_text("poisson")
    page.reload()
    expect(page.locator("[data-asked='material.E_mpa']")).to_have_value("3")
    expect(refused).to_contain_text("poisson")
    fill_in(page, wall_mm="2.5", poisson="0.5")
    expect(page.locator("[data-known='material.E_mpa']")).to_contain_text("3 MPa")
    expect(page.get_by_role("button", name="Analyse")).to_be_enabled()
    page.get_by_role("button", name="Back to what is known").click()
    expect(page.locator("[data-known='material.E_mpa']")).to_have_count(0)
    assert serious(page) == []


def test_an_analysis_that_failed_says_why_and_what_to_do(daemon: Daemon, open_page: Open) -> None:
    capture = daemon.capture(5)
    order = {"inputs": {"reference": {"field": 4000}}}
    job = daemon.ask(f"/captures/{capture}/analysis", body=order)["id"]
    daemon.wait_until_ended(job)
    problem = daemon.ask(f"/captures/{capture}")["analysis"]["problem"]
    page = open_page(f"{daemon.url}/#analysis/{capture}").page
    expect(page.locator("[data-failed]")).to_contain_text(problem["message"])
    expect(page.locator("[data-failed]")).to_contain_text(problem["hint"])
    expect(page.get_by_role("button", name="Analyse")).to_be_enabled()


def test_an_analysis_with_wrong_pressures_is_marked_wherever_it_is_listed(
    daemon: Daemon, open_page: Open
) -> None:
    capture = daemon.capture(5, bits=8)
    daemon.analyse(capture, plane="symmetry")
    path = daemon.folder / "analyses" / capture / "1" / "record.json"
    told = {"reference": "nominal", "material": {}, "vacuum": {}, "sought_kpa": 1.0}
    record = json.loads(path.read_text()) | {"pressure_method": None, "inputs": told, "lacks": []}
    path.write_text(json.dumps(record))
    page = open_page(f"{daemon.url}/#analysis/{capture}").page
    expect(page.locator("nav [data-outdated]")).to_have_text("wrong pressures")
    expect(page.locator("[data-analysis] [data-outdated]")).to_contain_text("Analyse the capture again")
    page.goto(f"{daemon.url}/#captures/{capture}")
    expect(page.locator(".analysis-links [data-outdated]")).to_be_visible()
    page.get_by_role("link", name="Analysis", exact=True).click()
    expect(page.locator("[data-analysis] [data-outdated]")).to_be_visible()


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_from_one_press_to_the_report_s_first_page(daemon: Daemon, open_page: Open, tmp_path: Path) -> None:
    page = open_page(f"{daemon.url}/#analysis/{daemon.capture(FIELDS, bits=8)}").page
    page.get_by_text("Change a value for this analysis").click()
    expect(page.locator("[data-lack='reference']")).to_be_visible()
    page.get_by_label("Measured from").select_option("nominal")
    page.get_by_label("Plane for the widths").select_option("symmetry")
    expect(page.locator("[data-lack='reference']")).to_have_count(0)
    page.get_by_role("button", name="Analyse").click()
    expect(page.get_by_role("progressbar")).to_be_visible()
    page.reload()  # the job is found again, and its result appears by itself
    expect(page.locator(".map-cell").first).to_be_visible(timeout=PATIENCE_MS)
    expect(page.locator(".map-parts").get_by_label("What is shown")).to_have_value("strain1")
    page.locator(".map-cell[fill^='rgb']").first.click()
    expect(page.locator(".map-touched")).to_contain_text("±")
    page.get_by_text("quantities were not found, and why").click()
    expect(page.locator(".analysis-without")).to_contain_text("There is no mean cycle")
    expect(page.locator("[data-analysis]").get_by_text("Without the liner's wall")).to_be_visible()
    expect(page.get_by_text("Not computed: Pressure on the teat").first).to_be_visible()
    report = page.get_by_role("link", name="Open the full report")
    assert page.request.get(f"{daemon.url}{report.get_attribute('href')}").ok
    zoomed_together_and_taken_home(page, tmp_path)
    assert serious(page) == []


def zoomed_together_and_taken_home(page: Page, folder: Path) -> None:
    """The curves of an analysis: one cursor, one range, a picture for paper, all numbers with their σ."""
    width = page.locator(".chart", has=page.get_by_role("heading", name="Width of the sections"))
    movement = page.locator(".chart", has=page.get_by_role("heading", name="Movement of the wall"))
    place = width.locator(".chart-place")
    place.focus()
    for key in ("+", "ArrowLeft"):
        page.keyboard.press(key)
    expect(movement.get_by_role("button", name="Show all")).to_be_visible()
    expect(movement.locator(".chart-when")).to_be_visible()
    line = width.locator(".chart-line").nth(1)
    line.click()
    expect(line).to_have_attribute("aria-pressed", "false")
    rows = list(csv.DictReader(saved(page, width, "csv", folder).read_text().splitlines()))
    assert len(rows) == FIELDS
    spreads = [name for name in rows[0] if name.startswith("sigma_distance_at_-")]
    assert spreads
    assert all(float(row[spreads[0]]) > 0 for row in rows)
    picture = cv2.imread(str(saved(page, width, "png", folder)))
    assert picture.shape[1] == 1600
    assert np.median(picture) == 255
    width.get_by_role("button", name="Show all").click()
    expect(movement.get_by_role("button", name="Show all")).to_be_hidden()


def saved(page: Page, chart: Locator, kind: str, folder: Path) -> Path:
    with page.expect_download() as download:
        chart.locator(f"[data-file='{kind}']").click()
    file = folder / download.value.suggested_filename
    download.value.save_as(file)
    return file


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_any_number_is_compared_by_quantities_and_mean_cycles(daemon: Daemon, open_page: Open) -> None:
    two = [daemon.capture(CYCLES, labels={"cow": name}) for name in ("8", "9")]
    for one in two:
        daemon.analyse(one, plane="symmetry")
    third = daemon.capture(FIELDS, labels={"cow": "9"})
    watched = open_page(f"{daemon.url}/#captures/{two[0]}")
    watched.expect_errors("404")
    page = watched.page
    page.get_by_role("link", name="Compare").click()
    for one in (two[1], third):
        page.get_by_label("Add a capture").click()
        page.locator(f"[data-choice='{one}']").click()
        expect(page.locator(f"[data-remove='{one}']")).to_be_visible()
    assert page.url.endswith(f"#compare/{'%2C'.join([*two, third])}")
    expect(page.locator(f"tr[data-capture='{third}']")).to_contain_text("not analysed")
    expect(page.locator("[data-differ]")).to_contain_text("nothing is tested")
    expect(page.locator("[data-compared='stroke_mm'] td").nth(0)).to_have_text(stroke(daemon, two[0]))
    expect(page.locator("[data-compared='stroke_mm'] td").nth(1)).to_have_text(stroke(daemon, two[1]))
    expect(page.locator(".chart-line")).to_have_count(2)
    page.get_by_role("button", name="Stroke, mm").click()
    expect(page.locator("th[aria-sort='ascending']")).to_contain_text("Stroke")
    expect(page.locator(".compare-table tbody tr").last).to_have_attribute("data-capture", third)
    page.get_by_role("button", name="Analyse the one").click()
    row = page.locator(f"tr[data-capture='{third}']")
    expect(row).not_to_contain_text("not analysed", timeout=PATIENCE_MS)
    assert serious(page) == []
    page.goto(f"{daemon.url}/#compare/{two[0]},nonsuch")
    expect(page.get_by_text("nonsuch (not found)")).to_be_visible()
    expect(page.locator(f"tr[data-capture='{two[0]}']")).to_be_visible()

    page.goto(f"{daemon.url}/#operate")
    page.get_by_role("radio", name="Pulsations").check()
    expect(page.locator("#length-rate-from")).to_have_text(f"As measured in capture {two[1]}.")
    measured_per_min = float(page.get_by_label("Pulsations a minute").input_value())
    assert abs(measured_per_min - 60.0) < 1.0
    page.get_by_label("Pulsations a minute").fill("90")
    expect(page.locator("#length-rate-from")).to_contain_text("As entered here. Last measured: ")
    page.get_by_label("Pulsations a minute").fill("")
    page.get_by_label("How many").focus()
    expect(page.locator("#length-rate-from")).to_contain_text("As measured")


@pytest.mark.slow
def test_an_analysis_that_runs_is_cancelled(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#analysis/{daemon.capture(CYCLES)}").page
    page.get_by_role("button", name="Analyse").click()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("Cancelled.")).to_be_visible()
    expect(page.get_by_role("button", name="Analyse")).to_be_enabled()
    assert daemon.ask("/jobs?limit=1")["jobs"][0]["state"] == "cancelled"
