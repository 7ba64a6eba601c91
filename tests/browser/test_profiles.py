"""Profiles on the page: written, changed, retired, and found by an analysis."""

import re

import pytest
import yaml
from playwright.sync_api import expect

from browser.axe import serious
from browser.conftest import Guarded, Open
from browser.daemons import Daemon
from browser.test_sign_in import sign_in
from liner.chain.analysis.profiling import COW, LINER, changed

PROFILES = "/api/v1/profiles"


def text_of(document: dict[str, object]) -> str:
    return yaml.safe_dump(document, allow_unicode=True, sort_keys=False)


def test_a_profile_is_stored_changed_and_retired_and_its_versions_stay(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(f"{daemon.url}/#captures").page
    page.get_by_role("link", name="Profiles").click()
    page.locator("[data-kind='cow']").get_by_role("link", name="New").click()
    text = page.get_by_label("The profile as text")
    expect(text).to_have_value(re.compile("kind: cow"))
    text.fill(text_of(changed(COW, "name", "Blåros")))
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Cow Blåros")
    text = page.get_by_label("The profile as text")
    text.fill(text_of(changed(changed(COW, "name", "Blåros"), "lactation", 3)))
    page.get_by_role("button", name="Save").click()
    expect(page.locator("[data-version]")).to_have_count(2)
    page.locator("[data-version='1']").click()
    expect(text).not_to_have_value(re.compile("lactation: 3"))
    assert serious(page) == []
    page.get_by_role("button", name="Retire").click()
    page.get_by_role("dialog").get_by_role("button", name="Retire").click()
    expect(page.locator("[data-panel='profile']")).to_contain_text("retired")
    page.goto(f"{daemon.url}/#profiles")
    expect(page.locator("[data-kind='cow']")).to_contain_text("None yet.")
    page.get_by_label("Show retired ones").check()
    expect(page.locator("[data-profile='Blåros']")).to_contain_text("version 2")


def test_everything_that_is_wrong_is_listed_and_the_text_stays(daemon: Daemon, open_page: Open) -> None:
    watched = open_page(f"{daemon.url}/#profiles/liner")
    watched.expect_errors("422")
    page = watched.page
    text = page.get_by_label("The profile as text")
    wrong = text_of(changed(changed(LINER, "material.E_sigma_mpa", None), "colour", "red"))
    text.fill(wrong)
    page.get_by_role("button", name="Save").click()
    said = page.locator(".note.is-bad li")
    expect(said.filter(has_text="colour: unknown key")).to_be_visible()
    expect(said.filter(has_text="material.E_sigma_mpa: is missing")).to_be_visible()
    expect(text).to_have_value(wrong)
    assert serious(page) == []


def test_a_viewer_reads_and_cannot_store(guarded: Guarded, open_page: Open) -> None:
    page = open_page(f"{guarded.url}/#profiles/cow").page
    sign_in(page, guarded.tokens["viewer"])
    expect(page.get_by_text("To save a profile, sign in with an operator token")).to_be_visible()
    expect(page.get_by_role("button", name="Save")).to_have_count(0)


@pytest.mark.slow
def test_an_analysis_takes_the_profiles_that_the_labels_find_and_says_so(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(f"{daemon.url}/#profiles/liner").page
    page.get_by_label("The profile as text").fill(text_of(changed(LINER, "name", "found")))
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Liner found")
    capture = daemon.capture(8, bits=8, labels={"liner": "found"})
    page.goto(f"{daemon.url}/#analysis/{capture}")
    stiffness = page.locator("[data-known='material.E_mpa']")
    expect(stiffness).to_contain_text("Liner found, version 1")
    page.get_by_text("Change a value for this analysis").click()
    rest = page.get_by_label("Fill in the rest from profiles")
    rest.uncheck()
    expect(stiffness).to_contain_text("given here")
    rest.check()
    expect(stiffness).to_contain_text("Liner found, version 1")
    page.get_by_role("button", name="Analyse").click()
    used = page.locator("[data-profiles]")
    expect(used).to_contain_text("Liner found, version 1", timeout=200_000)
