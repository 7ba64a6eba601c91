"""The calibration panel: what is active, and the guided way from the calibration frame to an accepted one."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from browser.axe import serious
from browser.conftest import PHONE, Guarded, Open, Start
from browser.daemons import Daemon

LONG_MS = 600_000
"""Computing a calibration on a computer that does other work as well."""
CONFIGURED = "fake-1-2"


@pytest.fixture(scope="module")
def at_the_frame(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon whose camera sees the calibration frame, and which has the shipped calibration alone."""
    with Daemon(tmp_path_factory.mktemp("frame"), scene="calibration_frame", location="weighted") as daemon:
        daemon.wait_until_it_streams()
        yield daemon


def signed_in(guarded: Guarded, open_page: Open, role: str, panel: str) -> Page:
    watched = open_page(f"{guarded.url}/#{panel}")
    watched.expect_errors("401")
    watched.page.get_by_label("Token").fill(guarded.tokens[role])
    watched.page.get_by_role("button", name="Sign in").click()
    watched.page.wait_for_selector("[data-panel^=calibration]")
    return watched.page


@pytest.mark.slow
def test_what_is_no_calibration_frame_is_refused_with_why_and_the_way_back(
    daemon: Daemon, open_page: Open
) -> None:
    capture = daemon.capture(fields=12, bits=8)
    page = open_page(f"{daemon.url}/#calibration/found/{capture}").page
    expect(page.get_by_text("It is not clear which target is which.")).to_be_visible(timeout=LONG_MS)
    expect(page.locator(".target-picture")).to_have_count(2)
    expect(page.locator(".note.is-bad")).to_contain_text("The instrument says:")
    expect(page.get_by_role("link", name="Next")).to_have_count(0)
    assert serious(page) == []
    page.get_by_role("link", name="Place the frame again").click()
    expect(page.get_by_role("heading", name="Place the calibration frame")).to_be_visible()


def imported(daemon: Daemon, calibration_id: str) -> dict[str, object]:
    document: dict[str, object] = daemon.ask(f"/calibrations/{CONFIGURED}")
    return document | {"id": calibration_id}


def test_one_from_a_file_is_stored_activated_and_another_one_rejected(
    daemon: Daemon, open_page: Open, tmp_path: Path
) -> None:
    page = open_page(f"{daemon.url}/#calibration").page
    page.get_by_text("Import a calibration").click()
    for name in ("of-may", "of-june"):
        file = tmp_path / f"{name}.json"
        file.write_text(json.dumps(imported(daemon, name)))
        page.get_by_label("File (.json)").set_input_files(file)
        expect(page.locator(f"[data-calibration={name}]")).to_be_visible()

    page.locator("[data-calibration=of-may]").get_by_role("button", name="Use it").click()
    page.get_by_role("dialog").get_by_role("button", name="Use it").click()
    expect(page.locator("[data-calibration=of-may]")).to_contain_text("In use")

    page.locator("[data-calibration=of-june]").get_by_role("link", name="Open").click()
    page.get_by_role("button", name="Reject").click()
    page.get_by_label("Why (optional)").fill("from another barn")
    page.get_by_role("dialog").get_by_role("button", name="Reject").click()
    expect(page.locator("[data-calibration=of-june]")).to_contain_text("Rejected: from another barn")
    assert daemon.ask("/state")["devices"]["simulated"]["calibration"]["id"] == "of-may"


def test_a_file_that_is_no_calibration_is_refused_in_words(
    daemon: Daemon, open_page: Open, tmp_path: Path
) -> None:
    watched = open_page(f"{daemon.url}/#calibration")
    watched.expect_errors("422")
    page = watched.page
    page.get_by_text("Import a calibration").click()
    for text in ("no JSON", "{}"):
        (tmp_path / "some.json").write_text(text)
        page.get_by_label("File (.json)").set_input_files(tmp_path / "some.json")
        expect(page.locator(".import .note.is-bad")).to_be_visible()


def test_a_viewer_may_look_and_is_offered_nothing_to_do(guarded: Guarded, open_page: Open) -> None:
    page = signed_in(guarded, open_page, "viewer", "calibration")
    expect(page.locator(f"[data-calibration={CONFIGURED}]")).to_contain_text("In use")
    assert page.locator("[data-do], input[type=file]").count() == 0
    page.goto(f"{guarded.url}/#calibration/place")
    expect(page.get_by_text("To calibrate, sign in with an operator token.")).to_be_visible()
    expect(page.get_by_role("link", name="Next")).to_have_count(0)


def test_what_both_views_show_comes_with_the_picture(at_the_frame: Daemon, open_page: Open) -> None:
    page = open_page(f"{at_the_frame.url}/#calibration").page
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.goto(f"{at_the_frame.url}/#calibration/place")
    expect(page.locator(".badge[data-view=right]")).to_have_text("Right view: 108 of 108")
    expect(page.get_by_text("Both views show the calibration frame well.")).to_be_visible()
    assert not [url for url in asked if url.endswith("/light")]


def test_without_a_signal_nobody_is_sent_to_the_lamp(start_daemon: Start, open_page: Open) -> None:
    daemon = start_daemon(faults=[{"kind": "no_signal", "at_s": 0.2, "duration_s": 6000.0}])
    page = open_page(f"{daemon.url}/#calibration").page
    lights: list[str] = []

    def hear(message: str | bytes) -> None:
        if isinstance(message, str):
            lights.append(message)

    page.on("websocket", lambda socket: socket.on("framereceived", hear))
    page.goto(f"{daemon.url}/#calibration/place")
    for _ in range(200):
        if len(lights) > 1:
            break
        page.wait_for_timeout(50)
    assert lights
    expect(page.locator(".note")).to_have_text("No picture from the camera.")
    expect(page.locator(".badge[data-view]")).to_have_count(0)


def test_without_a_grabber_there_is_no_picture_to_place_it_by(unplugged: Daemon, open_page: Open) -> None:
    page = open_page(f"{unplugged.url}/#calibration/place").page
    expect(page.get_by_text("No picture from the camera.")).to_be_visible()
    expect(page.locator(".badge[data-view]")).to_have_count(0)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_ten_second_check_says_whether_the_calibration_fits_and_can_be_cancelled(
    at_the_frame: Daemon, open_page: Open
) -> None:
    daemon = at_the_frame
    page = open_page(f"{daemon.url}/#calibration").page
    check = page.get_by_role("button", name="Check", exact=True)
    check.click()
    expect(page.get_by_role("progressbar")).to_be_visible()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("Cancelled.")).to_be_visible()
    expect(check).to_be_enabled()
    given_up = daemon.wait_until_sealed(daemon.ask("/captures?limit=1")["captures"][0]["id"])
    assert given_up["fields"] < 500

    check.click()
    expect(page.locator("[data-check]")).to_have_attribute("data-check", "fits", timeout=LONG_MS)
    expect(page.get_by_text("108 of 108 targets")).to_be_visible()
    page.reload()
    expect(page.locator("[data-check]")).to_have_attribute("data-check", "fits")
    assert serious(page) == []


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_computing_a_calibration_can_be_cancelled(at_the_frame: Daemon, open_page: Open) -> None:
    daemon = at_the_frame
    capture = daemon.capture(fields=50, bits=8)
    page = open_page(f"{daemon.url}/#calibration/adjust/{capture}").page
    page.get_by_role("button", name="Compute").click()
    expect(page.get_by_role("progressbar")).to_be_visible()
    page.get_by_role("button", name="Cancel").click()
    expect(page.get_by_text("Cancelled.")).to_be_visible()
    expect(page.get_by_role("button", name="Compute")).to_be_enabled()
    assert len(daemon.ask("/calibrations")["calibrations"]) == 1


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(
    ("language", "said"), [("en", "Failed: do not use it"), ("nb", "Ikke bestått: ikke bruk den")]
)
def test_a_failed_calibration_says_why_and_is_not_offered_to_an_operator(
    at_the_frame: Daemon, open_page: Open, language: str, said: str
) -> None:
    made = failed_calibration(at_the_frame)
    page = open_page(f"{at_the_frame.url}/#calibration/review/{made}", size=PHONE, language=language).page
    expect(page.locator("[data-verdict]")).to_have_attribute("data-verdict", "failed")
    expect(page.locator("[data-verdict]")).to_contain_text(said)
    expect(page.locator("[data-reason]").first).to_have_attribute("data-reason", "check_length")
    expect(page.locator("[data-do=accept]")).to_be_disabled()
    expect(page.locator("tbody").first.locator("tr")).to_have_count(11)
    good = page.locator("section[aria-labelledby=validity-title]")
    expect(good.locator("canvas.validity-picture")).to_have_count(2)
    expect(good.locator("tbody").last.locator("tr")).to_have_count(10)
    assert "{" not in page.locator("main").inner_text()
    assert page.evaluate("document.scrollingElement.scrollWidth <= innerWidth")
    assert serious(page) == []


def failed_calibration(daemon: Daemon) -> str:
    """One whose check length is two per cent off; made once."""
    for row in daemon.ask("/calibrations")["calibrations"]:
        if row["verdict"] == "failed":
            return str(row["id"])
    capture = daemon.capture(fields=50, bits=8)
    options = {"check_length": {"between": [1, 108], "length_mm": 117.0}}
    job = daemon.ask("/calibrations", body={"capture": capture, "options": options})["id"]
    return str(daemon.wait_until_done(job)["calibration"])
