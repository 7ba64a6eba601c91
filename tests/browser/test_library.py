"""The library of captures: narrowed down, seen at a glance, several handled at once, one chosen among all."""

import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, Route, expect

from browser.axe import serious
from browser.conftest import CHEAP, PHONE, Open
from browser.daemons import Daemon
from browser.pages import until

PATIENCE_MS = 60_000
LINER = "of the library"
MANY = 2000


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """One of its own: among more than six cows of other tests, these are not shown at once."""
    with Daemon(tmp_path_factory.mktemp("daemon"), location=CHEAP) as one:
        one.wait_until_it_streams()
        yield one


@pytest.fixture(scope="module")
def four(daemon: Daemon) -> list[str]:
    """Captures of cows 501 and 502, the newest last."""
    teats = ("front left", "front right")
    return [
        daemon.capture(25, labels={"cow": cow, "teat": teat, "liner": LINER}, note=f"try {cow} {teat}")
        for cow in ("501", "502")
        for teat in teats
    ]


def ids(page: Page) -> list[str]:
    rows = page.locator(".capture-item").all()
    return [row.get_attribute("data-capture") or "" for row in rows]


def test_captures_are_narrowed_down_by_touch_and_the_address_keeps_it(
    daemon: Daemon, four: list[str], open_page: Open
) -> None:
    page = open_page(f"{daemon.url}/#captures", size=PHONE).page
    page.get_by_text("Filter").click()
    page.get_by_role("button", name=re.compile("^501")).click()
    expect(page.get_by_role("status").filter(has_text=re.compile("^2 of"))).to_be_visible()
    expect(page.locator(".capture-item")).to_have_count(2)
    assert ids(page) == [four[1], four[0]]
    assert serious(page) == []
    page.get_by_label("Sort").select_option("time")
    expect(page.locator(".capture-item").first).to_have_attribute("data-capture", four[0])
    page.reload()
    expect(page.locator(".capture-item").first).to_have_attribute("data-capture", four[0])
    page.locator(".capture-row").first.click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("501")
    page.go_back()
    expect(page.locator(".capture-item")).to_have_count(2)
    page.get_by_label("Search").fill("right TRY")
    expect(page.locator(".capture-item")).to_have_count(1)
    assert ids(page) == [four[1]]


def test_a_row_says_in_words_and_pictures_what_was_captured(
    daemon: Daemon, four: list[str], open_page: Open
) -> None:
    page = open_page(f"{daemon.url}/#captures?search=502", look="dark", language="nb").page
    row = page.locator(f"[data-capture='{four[2]}']")
    expect(row).to_contain_text("Ku 502 · Venstre foran")
    expect(row).to_contain_text("i dag ")
    until(page, "id => document.querySelector(`[data-capture='${id}'] img`)?.naturalWidth === 180", four[2])
    expect(row.get_by_role("img", name="Veggens bredde")).to_be_visible(timeout=PATIENCE_MS)
    assert serious(page) == []


def test_several_are_chosen_by_keyboard_labelled_taken_home_and_deleted(
    daemon: Daemon, open_page: Open
) -> None:
    three = [daemon.capture(5, note="several at once") for _ in range(3)]
    watched = open_page(f"{daemon.url}/#captures")
    watched.expect_errors("410 (Gone)")  # the browser may still be about to load a deleted capture's picture
    page = watched.page
    expect(page.locator(".capture-item").first).to_be_visible()
    page.keyboard.press("/")
    page.keyboard.type("several at once")
    expect(page.locator(".capture-item")).to_have_count(3)
    for key in ("ArrowDown", "Space", "ArrowDown", "ArrowDown", "Space"):
        page.keyboard.press(key)
    expect(page.get_by_text("2 selected")).to_be_visible()
    bar = page.get_by_role("region", name="Selected captures")
    bar.get_by_role("button", name="Label").click()
    page.get_by_role("dialog").get_by_label("Cow").fill("503")
    page.get_by_role("dialog").get_by_role("button", name="Label").click()
    expect(page.locator(".capture-row", has_text="Cow 503")).to_have_count(2)
    with page.expect_download() as download:
        bar.get_by_role("link", name="Download").click()
    with zipfile.ZipFile(Path(download.value.path())) as archive:
        # Named by the minute in which they began: where both began in the same, one is "cow 503 (2)".
        assert len({name for name in archive.namelist() if "cow 503" in name}) == 2
    daemon.ask(f"/captures/{three[0]}", body={"pinned": True}, method="PATCH")
    bar.get_by_role("button", name="All shown").click()
    bar.get_by_role("button", name="Delete").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete 3").click()
    expect(page.get_by_role("alert").filter(has_text="Failed for 1 capture")).to_contain_text("is pinned")
    expect(page.locator(".capture-item")).to_have_count(1)
    assert ids(page) == [three[0]]
    assert serious(page) == []


def test_a_chooser_finds_any_capture_by_its_words(daemon: Daemon, four: list[str], open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#compare/{four[3]}").page
    expect(page.get_by_role("listitem").filter(has_text="Cow 502 · Front right")).to_be_visible()
    chooser = page.get_by_label("Add a capture")
    chooser.fill("501 left")
    expect(page.locator(".chooser-option")).to_have_count(1)
    assert serious(page) == []
    chooser.press("Enter")
    expect(page).to_have_url(re.compile(f"#compare/{four[3]}(,|%2C){four[0]}$"))
    expect(page.get_by_role("table").first).to_be_visible(timeout=PATIENCE_MS)


def test_what_narrows_down_has_its_name_before_the_first_answer(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#operate").page
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/api/v1/captures?*", hold)
    page.goto(f"{daemon.url}/#captures")
    expect(page.locator(".facets > summary")).to_have_text("Filter")
    assert serious(page) == []
    for route in held:
        route.continue_()


def test_a_long_list_keeps_few_rows_in_the_document(daemon: Daemon, four: list[str], open_page: Open) -> None:
    one = daemon.ask(f"/captures/{four[0]}") | {"runs": [], "analysis": None}

    def listed(route: Route) -> None:
        cursor = re.search(r"cursor=(\d+)", route.request.url)
        first = int(cursor.group(1)) if cursor else 0
        captures: list[Any] = [one | {"id": f"made-up-{i}"} for i in range(first, first + 25)]
        found = {
            "captures": captures,
            "next": str(first + 25),
            "total": MANY,
            "in_all": MANY,
            "widths_mm": {},
        }
        route.fulfill(json=found)

    watched = open_page(f"{daemon.url}/#operate")
    page = watched.page
    page.route("**/api/v1/captures?*", listed)
    page.route("**/thumbnail.png", lambda route: route.fulfill(status=204))
    page.goto(f"{daemon.url}/#captures")
    further = """parts => {
        scrollTo(0, document.body.scrollHeight);
        return document.querySelectorAll(".capture-list").length >= parts;
    }"""
    until(page, further, 16)
    assert page.locator(".capture-item").count() < 250
    page.evaluate("scrollTo(0, 0)")
    expect(page.locator("[data-capture='made-up-0']")).to_be_visible()
