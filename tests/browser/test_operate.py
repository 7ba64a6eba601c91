"""The operator's panel: state, Start and Stop."""

import re
import time

import pytest
from playwright.sync_api import Page, Route, expect

from browser.axe import serious
from browser.conftest import Open
from browser.daemons import Daemon


def length(page: Page, name: str) -> None:
    page.get_by_role("radio", name=name).check()


def is_in_state(page: Page, state: str) -> None:
    expect(page.locator(".state")).to_have_attribute("data-state", state)


def start(page: Page, daemon: Daemon) -> str:
    """Presses Start, and returns the id of the capture once that is over and the page shows how it ended."""
    with page.expect_response(lambda answer: answer.request.method == "POST") as started:
        page.get_by_role("button", name="Start").click()
    capture_id: str = started.value.json()["id"]
    fields = daemon.wait_until_sealed(capture_id)["fields"]
    expect(page.locator(".last")).to_contain_text(f"{fields} fields")
    expect(page.locator(".last")).to_contain_text("Complete")
    is_in_state(page, "ready")
    return capture_id


def test_the_state_is_a_word_with_a_symbol_and_since_when(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    is_in_state(page, "ready")
    expect(page.locator(".state h1")).to_have_text("Ready")
    expect(page.locator(".state-since")).to_contain_text("since")
    assert str(page.locator(".state > svg use").get_attribute("href")).endswith("#ready")


def test_from_start_to_stop(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Until stopped")
    page.get_by_label("Cow").fill("112")
    page.get_by_role("button", name="Start").click()
    is_in_state(page, "capturing")
    page.get_by_role("button", name="Stop").click()
    is_in_state(page, "ready")
    expect(page.locator(".last")).to_contain_text("Complete")
    newest = daemon.ask("/captures?limit=1")["captures"][0]
    assert newest["labels"] == {"cow": "112"}
    assert daemon.wait_until_sealed(newest["id"])["verdict"] == "complete"


def test_a_double_tap_starts_one_capture(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    before = len(daemon.ask("/captures")["captures"])
    length(page, "Fields")
    page.get_by_label("How many").fill("26")
    with page.expect_response(lambda answer: answer.request.method == "POST"):
        page.get_by_role("button", name="Start").dblclick()
    daemon.wait_until_none_runs()
    expect(page.locator(".last")).to_contain_text("26 fields")
    assert len(daemon.ask("/captures")["captures"]) == before + 1
    expect(page.locator(".toast.bad")).to_have_count(0)


def test_a_length_in_pulsations_is_shown_in_fields(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Pulsations")
    page.get_by_label("How many").fill("3")
    page.get_by_label("Pulsations a minute").fill("60")
    expect(page.locator("#length-is")).to_have_text("= 3.00 s, 150 fields")


def test_armed_first_then_triggered(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Fields")
    page.get_by_label("How many").fill("20")
    page.get_by_label("Wait for a second press").check()
    page.get_by_label("Before the start").fill("10")
    page.get_by_role("button", name="Arm").click()
    is_in_state(page, "armed")
    page.get_by_role("button", name="Start now").click()
    expect(page.locator(".last")).to_contain_text("30 fields")
    expect(page.locator(".last")).to_contain_text("Complete")


def test_no_length_is_no_order(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Seconds")
    page.get_by_label("How many").fill("")
    expect(page.get_by_role("button", name="Start")).to_be_disabled()
    expect(page.locator("#start-why")).to_have_text("Check the length below.")


def test_a_comma_is_a_decimal_sign_and_what_cannot_be_used_is_refused_beside_the_field(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(daemon.url).page
    length(page, "Seconds")
    field, problem = page.get_by_label("How many"), page.locator("#length-value-problem")
    field.fill("")
    field.press_sequentially("2,5")
    expect(page.locator("#length-is")).to_have_text("= 2.50 s, 125 fields")
    expect(problem).to_be_hidden()
    for typed, said in (
        ("-3", "-3 is less than 0.02, the least that is possible."),
        ("1.000,5", "“1.000,5” is not a number."),
        ("1e9", "1e9 is more than 200,000, the most that is possible."),
    ):
        field.fill(typed)
        expect(problem).to_have_text(said)
        expect(page.get_by_role("button", name="Start")).to_be_disabled()
        field.blur()
        expect(field).to_have_value(typed)
    length(page, "Fields")
    field.fill("2,5")
    expect(problem).to_have_text("“2,5” is not a whole number.")
    length(page, "Pulsations")
    page.get_by_label("Pulsations a minute").fill("62,5")
    field.focus()
    expect(page.get_by_label("Pulsations a minute")).to_have_value("62.5")


def test_while_a_capture_runs_the_screen_is_that_capture(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Seconds")
    page.get_by_label("How many").fill("600")
    page.get_by_label("Cow").fill("417")
    page.get_by_role("button", name="Start").click()
    is_in_state(page, "capturing")
    running = page.locator(".last")
    expect(running.get_by_role("heading")).to_have_text("Capturing: cow 417")
    expect(running.get_by_role("progressbar", name="Progress of the capture")).to_have_attribute(
        "value", re.compile(r"^0\.\d")
    )
    expect(running).to_contain_text("left")
    expect(running).to_contain_text("none lost")
    expect(page.locator(".curves")).to_be_visible()
    expect(page.get_by_label("How many")).to_be_hidden()
    assert serious(page) == []
    page.get_by_role("button", name="Stop").click()
    expect(running).to_contain_text("Complete")


def test_what_is_typed_while_a_capture_runs_labels_that_capture(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Until stopped")
    page.get_by_role("button", name="Start").click()
    is_in_state(page, "capturing")
    expect(page.get_by_text("About this capture")).to_be_visible()
    page.get_by_label("Cow").fill("33")
    page.get_by_label("Note").fill("kicked the cluster off")
    page.get_by_role("button", name="Stop").click()
    expect(page.locator(".last")).to_contain_text("Complete")
    expect(page.locator(".last")).to_contain_text("cow 33")
    newest = daemon.ask("/captures?limit=1")["captures"][0]
    assert (newest["labels"], newest["note"]) == ({"cow": "33"}, "kicked the cluster off")


def test_the_page_says_when_what_was_typed_is_stored(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Fields")
    page.get_by_label("How many").fill("27")
    start(page, daemon)
    stored = page.get_by_role("status").filter(has_text="Stored with the capture.")
    page.get_by_label("Note").fill("slipped")
    expect(stored).to_be_visible()
    assert daemon.ask("/captures?limit=1")["captures"][0]["note"] == "slipped"
    held: list[Route] = []

    def hold(route: Route) -> None:
        if route.request.method == "PATCH":
            held.append(route)
        else:
            route.continue_()

    page.route("**/api/v1/captures/*", hold)
    with page.expect_request(lambda request: request.method == "PATCH"):
        page.get_by_label("Note").fill("slipped twice")
    expect(stored).to_have_count(0)
    held[0].continue_()
    expect(stored).to_be_visible()


def test_what_is_typed_before_start_is_answered_is_of_the_new_capture(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(daemon.url).page
    page.clock.install()
    length(page, "Fields")
    page.get_by_label("How many").fill("28")
    page.get_by_label("Cow").fill("33")
    last = start(page, daemon)
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/api/v1/captures", hold)
    with page.expect_request(lambda request: request.method == "POST"):
        page.get_by_role("button", name="Same cow again").click()
    page.get_by_label("Cow").fill("34")
    page.get_by_label("Note").fill("restless")
    page.clock.run_for(1000)  # longer than a pause in typing, after which it is sent
    with page.expect_response(lambda answer: answer.request.method == "POST") as started:
        held[0].continue_()
    expect(page.get_by_role("status").filter(has_text="Stored with the capture.")).to_be_visible()
    said = [daemon.ask(f"/captures/{one}") for one in (last, started.value.json()["id"])]
    assert [(one["labels"], one["note"]) for one in said] == [
        ({"cow": "33"}, ""),
        ({"cow": "34"}, "restless"),
    ]


def test_the_next_cow_does_not_get_the_number_of_the_last_one(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    length(page, "Fields")
    page.get_by_label("How many").fill("30")
    page.get_by_label("Cow").fill("112")
    page.get_by_label("Liner").fill("A")
    page.get_by_role("button", name="Start").click()
    page.get_by_role("button", name="Next cow").click()
    expect(page.get_by_label("Cow")).to_have_value("")
    expect(page.get_by_label("Cow")).to_be_focused()
    expect(page.get_by_label("Liner")).to_have_value("A")
    page.get_by_label("Cow").fill("113")
    for name in ("Start", "Same cow again"):
        with page.expect_response(lambda answer: answer.request.method == "POST"):
            page.get_by_role("button", name=name).click()
    daemon.wait_until_none_runs()
    page.reload()  # what was typed survives
    expect(page.get_by_label("Cow")).to_have_value("113")
    page.get_by_role("button", name="Next cow").wait_for()
    labels = [one["labels"] for one in daemon.ask("/captures?limit=3")["captures"]]
    assert labels == [{"cow": "113", "liner": "A"}] * 2 + [{"cow": "112", "liner": "A"}]


def test_a_note_on_somebody_else_s_capture_leaves_it_its_labels(daemon: Daemon, open_page: Open) -> None:
    daemon.wait_until_none_runs()
    page = open_page(daemon.url).page
    is_in_state(page, "ready")
    page.get_by_label("Cow").fill("417")  # meant for the next one here
    other = daemon.ask("/captures", body={"labels": {"cow": "900"}})["id"]
    is_in_state(page, "capturing")
    with page.expect_response(lambda answer: answer.request.method == "PATCH"):
        page.get_by_label("Note").fill("seen from the other side")
    expect(page.locator(".last")).to_contain_text("cow 900")
    page.get_by_role("button", name="Stop").click()
    is_in_state(page, "ready")
    document = daemon.wait_until_sealed(other)
    assert document["labels"] == {"cow": "900"}
    assert daemon.ask(f"/captures/{other}")["note"] == "seen from the other side"


@pytest.mark.parametrize("arrives", [True, False])
def test_what_was_typed_for_a_capture_goes_to_it_or_to_none_though_the_next_one_runs_already(
    daemon: Daemon, open_page: Open, arrives: bool
) -> None:
    daemon.wait_until_none_runs()
    watched = open_page(daemon.url)
    watched.expect_errors("ERR_FAILED")
    page = watched.page
    page.clock.install()
    length(page, "Fields")
    page.get_by_label("How many").fill("31")
    own = start(page, daemon)
    daemon.wait_until_it_streams()
    page.clock.pause_at(time.time() + 3600)  # so that the typing does not pause, however long this takes
    page.get_by_label("Cow").fill("417")
    other = daemon.ask("/captures", body={"labels": {"cow": "900"}})["id"]
    is_in_state(page, "capturing")
    if not arrives:
        page.route(f"**/captures/{own}", lambda route: route.abort())
    with page.expect_request(lambda request: request.method == "PATCH" and own in request.url):
        page.get_by_label("Note").fill("seen from the other side")
    with page.expect_response(lambda answer: answer.request.method == "PATCH" and other in answer.url):
        page.clock.run_for(1000)
    daemon.ask(f"/captures/{other}/stop", method="POST")
    noted = daemon.wait_until_sealed(other)
    assert (noted["labels"], noted["note"]) == ({"cow": "900"}, "seen from the other side")
    assert daemon.ask(f"/captures/{own}")["labels"] == ({"cow": "417"} if arrives else {})
