"""Analyses asked for and looked at; two captures compared."""

import json
import re

import pytest
from playwright.sync_api import Page, expect

from browser.axe import serious
from browser.conftest import Open
from browser.daemons import Daemon

PATIENCE_MS = 200_000
FIELDS = 12
"""Too few for a cycle, enough for strain field by field."""
CYCLES = 160
"""Three of them, and a little."""
PER_MINUTE = re.compile(r"^(59|60)\.\d\d 1/min$")


def ask(page: Page) -> None:
    """What strain and widths need, and nothing else."""
    page.get_by_label("Counted from").select_option("nominal")
    page.get_by_label("Plane that widths count from").select_option("symmetry")


def test_what_is_left_empty_and_what_is_half_filled_in_is_said(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#analysis/{daemon.capture(5)}").page
    lack = page.locator("[data-group='reference'] .analysis-lack")
    expect(lack).to_contain_text("no strain")
    ask(page)
    expect(lack).to_be_hidden()
    page.get_by_label("Law of the rubber").select_option("linear")
    expect(page.locator("#analysis-why")).to_contain_text("Stiffness E")
    expect(page.get_by_role("button", name="Analyse")).to_be_disabled()
    expect(page.locator("[data-group='material'] .analysis-lack")).to_contain_text("Without the ends")
    page.get_by_label("First end").fill("-65")
    page.get_by_label("Last end").fill("65")
    expect(page.locator("[data-group='material'] .analysis-lack")).to_be_hidden()
    page.get_by_label("Law of the rubber").select_option("")
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
    expect(page.locator("[data-analysis] [data-outdated]")).to_contain_text("Start a new analysis below")
    page.goto(f"{daemon.url}/#captures/{capture}")
    expect(page.locator(".analysis-links [data-outdated]")).to_be_visible()


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_from_the_inputs_to_maps_and_report(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#analysis/{daemon.capture(FIELDS, bits=8)}").page
    ask(page)
    page.get_by_role("button", name="Analyse").click()
    expect(page.get_by_role("progressbar")).to_be_visible()
    expect(page.locator(".map-cell").first).to_be_visible(timeout=PATIENCE_MS)
    expect(page.locator(".map-parts").get_by_label("What is shown")).to_have_value("strain1")
    page.locator(".map-cell[fill^='rgb']").first.click()
    expect(page.locator(".map-touched")).to_contain_text("±")
    expect(page.locator("[data-analysis]").get_by_text("Without the wall")).to_be_visible()
    expect(page.get_by_text("Not computed: Pressure on the teat").first).to_be_visible()
    expect(page.locator(".chart", has_text="Width of the sections")).to_be_visible()
    report = page.get_by_role("link", name="Open the report")
    assert page.request.get(f"{daemon.url}{report.get_attribute('href')}").ok
    page.get_by_text("New analysis").click()
    page.get_by_role("button", name="Take over").click()
    expect(page.get_by_label("Counted from")).to_have_value("nominal")
    assert serious(page) == []


def test_two_captures_are_laid_over_each_other(daemon: Daemon, open_page: Open) -> None:
    one, other = daemon.capture(30, labels={"cow": "1"}), daemon.capture(20, labels={"cow": "2"})
    page = open_page(f"{daemon.url}/#captures/{one}").page
    page.get_by_role("link", name="Compare").click()
    page.get_by_label("Second capture").select_option(other)
    expect(page.locator("[data-fact='labels'] td")).to_have_text(["Cow 1", "Cow 2"])
    expect(page.locator("[data-fact='length'] td")).to_have_text(["0.6 s · 30 fields", "0.4 s · 20 fields"])
    expect(page.locator(".chart")).to_have_count(1)
    expect(page.get_by_text("analyse both first")).to_be_visible()
    in_the_middle = page.locator("#target").input_value()
    page.get_by_role("button", name="The next target").click()
    beside = page.locator("#target").input_value()
    assert beside != in_the_middle
    expect(page.locator(".chart h2")).to_contain_text(beside)
    page.get_by_role("radio", name="Width in the middle").check()
    expect(page.get_by_role("heading", name="Width of the middle section")).to_be_visible()


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_two_that_are_analysed_are_laid_over_each_other_by_the_cycle(daemon: Daemon, open_page: Open) -> None:
    two = [daemon.capture(CYCLES) for _ in range(2)]
    for one in two:
        daemon.analyse(one, plane="symmetry")
    page = open_page(f"{daemon.url}/#compare/{two[0]}/{two[1]}").page
    expect(page.get_by_role("radio", name="Over the cycle")).to_be_checked()
    expect(page.locator("[data-fact='rate'] td")).to_have_text([PER_MINUTE, PER_MINUTE])
    expect(page.locator(".chart canvas")).to_be_visible()
    expect(page.get_by_text("analyse both first")).to_have_count(0)
    page.get_by_role("radio", name="Over time").check()
    expect(page.locator(".chart canvas")).to_be_visible()
    assert serious(page) == []

    page.goto(f"{daemon.url}/#operate")
    page.get_by_role("radio", name="Pulsations").check()
    expect(page.locator("#length-rate-from")).to_have_text(f"As measured in capture {two[1]}.")
    measured_per_min = float(page.get_by_label("Pulsations a minute").input_value())
    assert abs(measured_per_min - 60.0) < 1.0
    page.get_by_label("Pulsations a minute").fill("90")
    expect(page.locator("#length-rate-from")).to_contain_text("As entered here. Measured last: ")
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
