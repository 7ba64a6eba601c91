"""The lights: what is well, and what to do where it is not."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from browser.axe import serious
from browser.conftest import CHEAP, Open
from browser.daemons import Daemon

ALL = [
    "device",
    "signal",
    "rate",
    "lost",
    "ring",
    "computer",
    "calibration",
    "measurement",
    "rig",
    "order",
    "disk",
    "records",
    "clock",
]
NOTICED_MS = 120_000


def has_level(page: Page, light: str, level: str) -> None:
    expect(page.locator(f'[data-light="{light}"]')).to_have_attribute("data-level", level, timeout=NOTICED_MS)


def opened(page: Page, light: str, level: str) -> Locator:
    """The light, with what it says, once it has that level."""
    has_level(page, light, level)
    found = page.locator(f'[data-light="{light}"]')
    found.locator("summary").click()
    return found


def test_every_light_has_a_word_and_what_is_well_is_green(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    assert page.locator(".light").count() == len(ALL)
    for light in ALL:
        assert page.locator(f'[data-light="{light}"] .light-word').inner_text()
    for light in set(ALL) - {"ring", "computer"}:  # these depend on how busy this computer is
        has_level(page, light, "good")


def test_a_light_that_is_well_says_what_it_means(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url).page
    page.get_by_text("Camera and mirrors", exact=True).click()
    expect(page.locator('[data-light="rig"]')).to_contain_text("still where they were")


def test_a_grabber_that_is_pulled_out_is_noticed_with_reasons_and_advice(
    unplugged: Daemon, open_page: Open
) -> None:
    page = open_page(unplugged.url).page
    has_level(page, "device", "bad")
    expect(page.locator(".state")).to_have_attribute("data-state", "absent")
    expect(page.locator("#start-why")).to_have_text("No grabber is plugged in.")
    page.get_by_role("button", name="Grabber: Not found").click()
    light = page.locator('[data-light="device"]')
    expect(light).to_contain_text("Since")
    expect(light).to_contain_text("its plug is loose")
    expect(light).to_contain_text("Push the plug in firmly")
    assert serious(page) == []


@pytest.fixture(scope="module")
def busy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon whose grabber another program has."""
    faults = [{"kind": "refuse", "at_s": 0.0, "duration_s": 600.0, "why": "busy"}]
    with Daemon(tmp_path_factory.mktemp("busy"), location=CHEAP, faults=faults) as one:
        yield one


@pytest.mark.parametrize(
    ("language", "what"),
    [("en", "Another program is using the grabber."), ("nb", "Et annet program bruker bildefangeren.")],
)
def test_what_the_daemon_finds_wrong_is_said_in_the_language_of_the_page(
    busy: Daemon, open_page: Open, language: str, what: str
) -> None:
    page = open_page(busy.url, language=language).page
    light = opened(page, "device", "bad")
    expect(light).to_contain_text(what)
    expect(light).not_to_contain_text("simulated")


def test_numbers_of_a_grabber_that_is_gone_are_not_shown_as_if_they_were_current(
    unplugged: Daemon, open_page: Open
) -> None:
    page = open_page(unplugged.url).page
    has_level(page, "device", "bad")
    expect(page.locator(".viewfinder")).to_contain_text("Nothing is being measured", timeout=NOTICED_MS)
    expect(page.locator(".viewfinder")).not_to_contain_text("residual")


def test_a_tablet_with_a_wrong_clock_is_told(daemon: Daemon, open_page: Open) -> None:
    watched = open_page(daemon.url)
    watched.page.clock.install(time="2030-01-01T00:00:00Z")
    watched.page.reload()
    has_level(watched.page, "clock", "warn")
    expect(watched.page.locator('[data-light="clock"]')).to_contain_text("behind this tablet")


@pytest.fixture(scope="module")
def lossy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon whose grabber loses four fields of five."""
    faults = [{"kind": "lose", "at_field": 10 + 50 * second, "count": 40} for second in range(600)]
    with Daemon(tmp_path_factory.mktemp("lossy"), location=CHEAP, faults=faults) as one:
        yield one


@pytest.mark.parametrize(
    ("language", "word", "start"),
    [("en", "Needs attention", "Start anyway"), ("nb", "Trenger tilsyn", "Start likevel")],
)
def test_a_grabber_that_loses_most_fields_is_not_called_ready(
    lossy: Daemon, open_page: Open, language: str, word: str, start: str
) -> None:
    page = open_page(lossy.url, language=language).page
    expect(page.locator(".state")).to_have_attribute("data-state", "troubled", timeout=NOTICED_MS)
    expect(page.locator(".state h1")).to_have_text(word)
    expect(page.locator(".state-reason")).not_to_be_empty()
    expect(page.get_by_role("button", name=start)).to_be_enabled()
    expect(page.locator("#start-why")).not_to_be_empty()
    assert serious(page) == []


@pytest.fixture(scope="module")
def frozen(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon that the computer stops for two seconds, again and again: a light tells of the last minute.

    It keeps the camera's pace until the module ends, so its tests are the last ones.
    """
    faults = [{"kind": "freeze", "at_s": at_s, "duration_s": 2.0} for at_s in range(3, 600, 20)]
    with Daemon(tmp_path_factory.mktemp("frozen"), location=CHEAP, faults=faults, idle_slowness=1) as one:
        yield one


@pytest.mark.parametrize(("language", "words"), [("en", "fields were lost"), ("nb", "delbilder gikk tapt")])
def test_a_program_that_took_no_fields_in_time_has_a_light(
    frozen: Daemon, open_page: Open, language: str, words: str
) -> None:
    page = open_page(frozen.url, language=language).page
    expect(opened(page, "computer", "warn")).to_contain_text(words)
    assert serious(page) == []
