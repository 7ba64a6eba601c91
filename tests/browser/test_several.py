"""The page of a daemon with two grabbers: one is chosen, or all of them are captured together."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from playwright.sync_api import APIResponse, Page, Route, expect

from browser.conftest import CHEAP, Open
from browser.daemons import Daemon
from grabberd.config import shipped_configs

TOGETHER = "All grabbers together"


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """The first two of the example's four."""
    folder: Path = tmp_path_factory.mktemp("daemon")
    document = yaml.safe_load((shipped_configs() / "four.yaml").read_text())
    for device in document["devices"].values():
        device |= {key: str(shipped_configs() / device[key]) for key in ("calibration", "object")}
    document["devices"] = dict(list(document["devices"].items())[:2])
    config = folder / "two.yaml"
    config.write_text(yaml.safe_dump(document))
    with Daemon(folder, config=str(config), location=CHEAP) as one:
        one.wait_until_it_streams()
        yield one


def is_in_state(page: Page, state: str) -> None:
    expect(page.locator(".state")).to_have_attribute("data-state", state)


def arm_together(page: Page, fields: int) -> None:
    page.get_by_role("radio", name="Fields").check()
    page.get_by_label("How many").fill(str(fields))
    page.get_by_label("Wait for a second press").check()
    page.get_by_label(TOGETHER).check()
    page.get_by_role("button", name="Arm").click()
    is_in_state(page, "armed")


def newest(daemon: Daemon) -> list[dict[str, object]]:
    captures: list[dict[str, object]] = daemon.ask("/captures?limit=2")["captures"]
    return captures


def test_all_grabbers_are_started_and_stopped_together(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    page.get_by_role("radio", name="Until stopped").check()
    page.get_by_label(TOGETHER).check()
    page.get_by_role("button", name="Start").click()
    is_in_state(page, "capturing")
    page.get_by_role("button", name="Stop").click()
    is_in_state(page, "ready")
    one, other = newest(daemon)
    assert {one["device"], other["device"]} == {"front-left", "front-right"}
    assert one["group"] == other["group"] is not None


def test_all_grabbers_are_armed_and_triggered_together(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    arm_together(page, 20)
    page.get_by_role("button", name="Start now").click()
    expect(page.locator(".last")).to_contain_text("20 fields")  # complete or not: the computer may be busy
    one, other = newest(daemon)
    assert one["group"] == other["group"] is not None


def test_start_now_counts_before_the_answer_to_arm_has_come(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    answers: list[tuple[Route, APIResponse]] = []
    page.route("**/api/v1/capture-groups", lambda route: answers.append((route, route.fetch())))
    arm_together(page, 22)
    page.get_by_role("button", name="Start now").click()
    expect(page.locator(".last")).to_contain_text("22 fields")
    ((route, answer),) = answers
    route.fulfill(response=answer)


def test_the_last_capture_is_that_of_the_grabber_that_is_chosen(daemon: Daemon, open_page: Open) -> None:
    daemon.capture(7, device="front-left")
    daemon.capture(9, device="front-right")
    page = open_page(daemon.url).page
    expect(page.locator(".state-device")).to_have_text("front-left")
    expect(page.locator(".last")).to_contain_text("7 fields")
    page.get_by_label("Menu").click()
    page.get_by_role("combobox", name="Grabber").select_option("front-right")
    expect(page.locator(".state-device")).to_have_text("front-right")
    expect(page.locator(".last")).to_contain_text("9 fields")
