"""Guided tests of a liner on the page: from the choice of a liner to what is stored in its profile."""

import re
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from archive.liner_tests import FAILED, PASSED, stored_test
from browser.axe import serious
from browser.conftest import Guarded, Open
from browser.daemons import Daemon
from browser.test_sign_in import sign_in
from grabberd_liner.guided_tests.store import LinerTestStore
from liner.chain.analysis.profiling import LINER, changed

PATIENCE_MS = 200_000
RAMP = "Ramp without a teat"


def liner(daemon: Daemon, name: str) -> dict[str, Any]:
    """A liner's profile, stored."""
    profile = changed(LINER, "name", name)
    daemon.ask("/profiles", body={"profile": profile})
    return profile


def store_of(daemon: Daemon) -> LinerTestStore:
    return LinerTestStore(daemon.folder / "tests")


def offer(profile: dict[str, Any], after: int = 1) -> dict[str, Any]:
    content = changed(profile, "material.E_mpa", 3.4)
    return {"profile": content, "after": after, "changes": ["material.E_mpa: 3 becomes 3.4 ± 0.1 MPa"]}


def choose(page: Page, name: str) -> None:
    page.locator("#test-liner").select_option(name)


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_liner_is_chosen_captured_by_one_press_evaluated_and_judged(
    daemon: Daemon, open_page: Open
) -> None:
    liner(daemon, "pressed")
    daemon.wait_until_none_runs()
    page = open_page(f"{daemon.url}/#operate").page
    page.get_by_role("link", name="Tests").click()
    choose(page, "pressed")
    expect(page.get_by_text("Earlier tests of liner pressed")).to_be_visible()
    page.get_by_role("link", name="Reference state").click()
    expect(page.get_by_text("Turn the vacuum off. Open both hoses.")).to_be_visible()
    expect(page.locator("[data-condition='device']")).to_have_attribute("data-level", "good")
    expect(page.locator("[data-condition='measures']")).to_have_attribute("data-level", "good")
    page.get_by_role("button", name="Start").click()
    expect(page.get_by_role("progressbar", name="Capturing")).to_be_visible()
    daemon.wait_until_recorded(10)
    page.get_by_role("button", name="Stop").click()
    capture = daemon.ask("/captures?limit=1")["captures"][0]
    assert (capture["labels"], capture["bits"]) == ({"test": "reference", "liner": "pressed"}, 8)
    page.reload()  # nothing is lost: the capture's test is followed where it is
    expect(page.locator("[data-result]")).to_be_visible(timeout=PATIENCE_MS)
    expect(page.locator("[data-check]").first).to_be_visible()
    (row,) = daemon.ask("/tests?liner=pressed")["tests"]
    assert page.url.endswith(f"#test/{row['id']}")
    assert page.locator("[data-result]").get_attribute("data-result") == row["verdict"]
    assert page.request.get(f"{daemon.url}/api/v1/tests/{row['id']}/report").ok
    (analysed,) = daemon.ask(f"/captures/{capture['id']}/analyses")["analyses"]
    assert analysed["job"] == row["id"], "the test's analysis is the capture's"
    assert serious(page) == []


def test_a_check_that_failed_says_why_and_what_to_do(daemon: Daemon, open_page: Open) -> None:
    test = stored_test(store_of(daemon), 11, liner="crooked", verdict="failed", checks=[PASSED, FAILED])
    page = open_page(f"{daemon.url}/#test/{test}").page
    expect(page.get_by_role("heading", name=f"{RAMP}: failed")).to_be_visible()
    failed = page.locator("[data-check='mounted_radius']")
    expect(failed).to_contain_text("13.600 ± 0.050 mm")
    expect(failed).to_contain_text("The mounted radius is 13.6 mm, the profile says 12.5 mm.")
    expect(failed).to_contain_text("What to do: Mount the liner again")
    expect(page.locator("[data-check='touch'] [data-verdict]")).to_have_text("Passed")
    expect(page.locator("[data-quantity='touch_kpa']")).to_contain_text("12.38 ± 0.21 kPa")
    expect(page.get_by_role("button", name="Save to the profile")).to_have_count(0)
    report = page.get_by_role("link", name="One-page report")
    assert page.request.get(f"{daemon.url}{report.get_attribute('href')}").ok
    assert serious(page) == []
    page.get_by_role("link", name="Test again").click()
    expect(page.get_by_role("heading", name=RAMP)).to_be_visible()


def test_what_a_test_offers_is_stored_by_a_press_and_is_then_the_profiles(
    daemon: Daemon, open_page: Open
) -> None:
    test = stored_test(store_of(daemon), 12, liner="stiff", offer=offer(liner(daemon, "stiff")))
    page = open_page(f"{daemon.url}/#tests").page
    choose(page, "stiff")
    page.locator("a[data-test]", has_text=RAMP).click()
    expect(page.locator("[data-offer]")).to_contain_text("E_mpa: 3 becomes 3.4 ± 0.1 MPa")
    page.get_by_role("button", name="Save to the profile").click()
    expect(page.locator("[data-stored='2']")).to_be_visible()
    assert daemon.ask("/profiles/liner/stiff")["profile"]["material"]["E_mpa"] == 3.4
    page.reload()
    expect(page.locator("[data-stored='2']")).to_be_visible()
    assert serious(page) == []
    page.get_by_role("link", name="Liner stiff").click()
    expect(page.get_by_label("The profile as text")).to_have_value(re.compile("E_mpa: 3.4"))
    daemon.ask("/profiles/liner/stiff", body={"yaml": "kind: liner\nname: stiff\n"}, method="PUT")
    page.goto(f"{daemon.url}/#test/{test}")
    expect(page.get_by_text("The profile has changed since (now version 3, the test used 1)")).to_be_visible()


def test_known_pressures_are_captured_one_by_one_and_what_was_typed_survives_a_reload(
    daemon: Daemon, open_page: Open
) -> None:
    liner(daemon, "squeezed")
    daemon.wait_until_none_runs()
    page = open_page(f"{daemon.url}/#tests/artificial-teat").page
    expect(page.get_by_text("Choose the liner first.")).to_be_visible()
    choose(page, "squeezed")
    expect(page.get_by_text("Enter the pressure first.")).to_be_visible()
    pressure = page.get_by_label("Pressure in the artificial teat kPa", exact=True)
    page.get_by_role("button", name="Pressure in the artificial teat: More").click()
    expect(pressure).to_have_value("2")
    pressure.fill("2,5")
    page.reload()
    expect(pressure).to_have_value("2,5")
    page.get_by_role("button", name="Start").click()
    page.get_by_role("button", name="Stop").click()
    expect(page.get_by_label("2.5 kPa")).to_be_checked()
    expect(page.get_by_text("Select at least two captures.")).to_be_visible()
    expect(page.get_by_role("button", name="Evaluate")).to_be_disabled()
    capture = daemon.ask("/captures?limit=1")["captures"][0]
    assert capture["labels"] == {"test": "artificial-teat", "liner": "squeezed", "known_kpa": "2.5"}
    assert capture["analysis"] is None, "it is analysed with the others"


def test_a_viewer_reads_tests_and_cannot_make_or_accept_one(guarded: Guarded, open_page: Open) -> None:
    page = open_page(f"{guarded.url}/#tests/reference").page
    sign_in(page, guarded.tokens["viewer"])
    expect(page.get_by_text("To run a test, sign in with an operator token.")).to_be_visible()
    expect(page.get_by_role("button", name="Start")).to_have_count(0)
