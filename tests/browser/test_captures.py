"""Captures: found, looked at, labelled, taken home, deleted."""

import csv
from pathlib import Path
from typing import Any

from playwright.sync_api import Page, Route, expect

from browser.axe import serious
from browser.conftest import PHONE, Open, Start
from browser.daemons import Daemon

PATIENCE_MS = 60_000
LOSSES = [{"at_field": n, "kind": "lose", "count": 3} for n in range(100, 60_000, 100)]
"""Three fields of every hundred: a capture of a few more has some."""


def row(page: Page, capture_id: str) -> Any:
    return page.locator(f"[data-capture='{capture_id}']")


def verdict(page: Page, word: str) -> None:
    expect(page.locator(f"[data-verdict='{word}']").first).to_be_visible(timeout=PATIENCE_MS)


def test_from_start_to_a_downloaded_csv(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    page.get_by_role("radio", name="Fields").check()
    page.get_by_label("How many").fill("25")
    page.get_by_label("Cow").fill("5417")
    page.get_by_role("button", name="Start").click()
    page.get_by_role("link", name="Captures").click()
    page.locator(".capture-row", has_text="Cow 5417").click()
    verdict(page, "complete")
    with page.expect_download() as download:
        page.get_by_role("link", name="Points as CSV").click(timeout=PATIENCE_MS)
    points = list(csv.DictReader(Path(download.value.path()).read_text().splitlines()))
    assert {int(point["n"]) for point in points} == set(range(25))
    assert all(float(point["sigma_z_mm"]) > 0 for point in points)


def test_points_for_other_programs_are_downloaded_and_a_refusal_is_shown_instead_of_saved(
    daemon: Daemon, open_page: Open
) -> None:
    watched = open_page(f"{daemon.url}/#captures/{daemon.capture(5)}")
    watched.expect_errors("422")
    page = watched.page
    for name, begins in (("Points as MAT", b"MATLAB 5.0 MAT-file"), ("Points as C3D", b"\x02\x50")):
        with page.expect_download() as download:
            page.get_by_role("link", name=name).click(timeout=PATIENCE_MS)
        assert Path(download.value.path()).read_bytes().startswith(begins)
    refusal = {"detail": "`points` would take 3.1 GB", "hint": "download the capture"}
    page.route("**/points.parquet", lambda route: route.fulfill(status=422, json=refusal))
    page.get_by_role("link", name="Points as Parquet").click()
    expect(page.get_by_role("alert").filter(has_text="3.1 GB")).to_contain_text("download the capture")


def test_a_running_capture_is_shown_as_it_grows_and_cannot_be_deleted(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(daemon.url).page
    expect(page.locator(".state")).to_have_attribute("data-state", "ready", timeout=PATIENCE_MS)
    running = daemon.ask("/captures", body={})["id"]
    page.get_by_role("link", name="Captures").click()
    expect(row(page, running)).to_contain_text("Recording")
    row(page, running).click()
    expect(page.get_by_role("button", name="Delete")).to_be_disabled()
    expect(page.locator("#delete-why")).to_contain_text("still being recorded")
    daemon.wait_until_recorded(1)
    page.get_by_role("button", name="Stop").click()
    verdict(page, "complete")
    expect(page.get_by_role("button", name="Delete")).to_be_enabled()
    page.get_by_role("link", name="Replay").click()
    expect(page.locator(".replay-when")).to_have_text("Field 0, 0.00 s")


def test_what_is_said_of_a_capture_is_found_again(daemon: Daemon, open_page: Open) -> None:
    one, other = daemon.capture(5, labels={"cow": "11"}), daemon.capture(5)
    page = open_page(f"{daemon.url}/#captures/{one}", size=PHONE).page
    page.get_by_label("Cow").fill("")
    page.get_by_label("Teat").select_option("rear left")
    page.get_by_label("Note").fill("slipped")
    page.get_by_role("button", name="Save").click()
    expect(page.get_by_role("heading", level=1)).to_contain_text("Rear left")
    said = daemon.ask(f"/captures/{one}")
    assert (said["labels"], said["note"]) == ({"teat": "rear left"}, "slipped")
    page.get_by_role("link", name="Captures").first.click()
    page.get_by_label("Search").fill("slip")
    expect(row(page, other)).to_have_count(0)
    expect(row(page, one)).to_contain_text("slipped")


def test_a_capture_is_pinned_and_deleted_after_a_question(daemon: Daemon, open_page: Open) -> None:
    one = daemon.capture(5)
    page = open_page(f"{daemon.url}/#captures/{one}").page
    page.get_by_role("button", name="Pin").click()
    expect(page.locator("#delete-why")).to_contain_text("Unpin it first")
    expect(page.get_by_role("button", name="Delete")).to_be_disabled()
    page.get_by_role("button", name="Unpin").click()
    page.get_by_role("button", name="Delete").click()
    page.get_by_role("dialog").get_by_role("button", name="Cancel").click()
    assert daemon.ask(f"/captures/{one}")["id"] == one
    page.get_by_role("button", name="Delete").click()
    page.get_by_role("dialog").get_by_role("button", name="Delete").click()
    expect(page.get_by_role("heading", level=1)).to_have_text("Captures")
    expect(row(page, one)).to_have_count(0)
    assert one not in [capture["id"] for capture in daemon.ask("/captures")["captures"]]


def test_an_answer_from_before_a_change_does_not_undo_it(daemon: Daemon, open_page: Open) -> None:
    one = daemon.capture(5)
    page = open_page(daemon.url).page
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/points?*", hold)
    with page.expect_request("**/points?*"):
        page.goto(f"{daemon.url}/#captures/{one}")
    page.get_by_role("button", name="Pin").click()
    expect(page.locator("#delete-why")).to_contain_text("Unpin it first")
    held[0].continue_()
    expect(page.get_by_text("targets per field on average")).to_be_visible()
    expect(page.locator("#delete-why")).to_contain_text("Unpin it first")


def test_a_capture_is_measured_again(daemon: Daemon, open_page: Open) -> None:
    one = daemon.capture(5)
    page = open_page(f"{daemon.url}/#captures/{one}").page
    page.get_by_role("button", name="Measure again").click()
    expect(page.get_by_text("afterwards")).to_be_visible(timeout=PATIENCE_MS)
    assert len(daemon.ask(f"/captures/{one}")["runs"]) == 2
    assert serious(page) == []


def test_nothing_can_be_pressed_before_the_capture_is_known(daemon: Daemon, open_page: Open) -> None:
    one = daemon.capture(5)
    page = open_page(f"{daemon.url}/#captures").page
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route(f"**/api/v1/captures/{one}", hold, times=1)
    with page.expect_request(f"**/api/v1/captures/{one}"):
        page.goto(f"{daemon.url}/#captures/{one}")
    expect(page.locator("[data-do=measure]")).to_have_count(1)
    assert not any(button.is_visible() for button in page.locator(".capture-parts button").all())
    held[0].continue_()
    expect(page.get_by_role("button", name="Measure again")).to_be_visible()
    expect(page.get_by_role("button", name="Pin")).to_be_visible()


def test_what_a_new_measurement_warns_of_stays_on_the_page(daemon: Daemon, open_page: Open) -> None:
    warning = "1 field was left out: the disk has changed it"

    def warned(route: Route) -> None:
        answer = route.fetch()
        job = answer.json()
        if job.get("result"):
            job["result"]["warnings"] = [warning]
        route.fulfill(response=answer, json=job)

    one = daemon.capture(5)
    page = open_page(f"{daemon.url}/#captures/{one}").page
    page.route("**/api/v1/jobs/*", warned)
    page.get_by_role("button", name="Measure again").click()
    expect(page.get_by_text("afterwards")).to_be_visible(timeout=PATIENCE_MS)
    expect(page.get_by_text(warning)).to_be_visible()
    expect(page.get_by_text("Warnings from the new measurement:")).to_be_visible()
    assert serious(page) == []


def test_a_viewer_reads_what_was_lost_and_is_offered_no_change(start_daemon: Start, open_page: Open) -> None:
    guarded = start_daemon(faults=LOSSES)
    tokens = {role: guarded.add_token(role, role) for role in ("viewer", "operator")}
    order = {"fields": 120, "labels": {"cow": "9"}}
    guarded.wait_until_it_streams(tokens["operator"])
    one = guarded.ask("/captures", tokens["operator"], order)["id"]
    watched = open_page(f"{guarded.url}/#captures/{one}")
    watched.expect_errors("401")
    page = watched.page
    page.get_by_label("Token").fill(tokens["viewer"])
    page.get_by_role("button", name="Sign in").click()
    verdict(page, "incomplete")
    expect(page.locator(".capture-ledger")).to_contain_text("3 fields lost at")
    for name in ("Delete", "Pin", "Save", "Measure again", "Stop"):
        expect(page.get_by_role("button", name=name, exact=True)).to_have_count(0)
    first = guarded.ask(f"/captures/{one}", tokens["viewer"])["ledger"]["entries"][0]["first_n"]
    page.locator(".strip-list button").first.click()
    expect(page.locator(".replay-when")).to_contain_text(f"Field {first},")
    expect(page.locator(".picture-missing")).to_contain_text("This field was lost")
