"""The live picture, and the aid for lamp and lens."""

import json
import re
import urllib.request
from collections.abc import Callable
from typing import Any

from playwright.sync_api import expect

from browser.axe import serious
from browser.conftest import PHONE, Open, Start
from browser.daemons import Daemon
from browser.pages import spread, touch, until

WHITE = """() => {
    const canvas = document.querySelector('.picture-canvas');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let white = 0;
    for (let i = 0; i < data.length; i += 4) white += data[i] > 200 && data[i + 1] > 200 && data[i + 2] > 200;
    return white;
}"""
LEVELS = """() => {
    const canvas = document.querySelector('.picture-canvas');
    const { data } = canvas.getContext('2d').getImageData(20, 60, 60, canvas.height - 80);
    return new Set(data.filter((_, i) => i % 4 === 0)).size;
}"""
"""How many grey values there are between the left border and the targets, and in the first of them."""
TINTED = """() => {
    const canvas = document.querySelector('.picture-canvas');
    const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
    let tinted = 0;
    for (let i = 0; i < data.length; i += 4) {
        tinted += data[i] === 255 && data[i + 1] === 42 && data[i + 2] === 58;
    }
    return tinted;
}"""
HIDE = """(hidden) => {
    Object.defineProperty(document, 'hidden', { value: hidden, configurable: true });
    document.dispatchEvent(new Event('visibilitychange'));
}"""
PICTURE = "() => document.querySelector('.picture-canvas').toDataURL()"


def live(daemon: Daemon, open_page: Open, **options: object) -> Any:
    page = open_page(f"{daemon.url}/#live", **options).page
    shows_targets(page)
    return page


def shows_targets(page: Any) -> None:
    """Waits for a picture with targets in it, which make at least three hundred of its pixels white."""
    expect(page.locator(".picture-canvas")).to_be_visible()
    until(page, f"() => ({WHITE})() > 250")


def changes(page: Any, before: str) -> None:
    until(page, f"(before) => ({PICTURE})() !== before", before)


def test_the_picture_shows_white_targets_and_goes_on(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    expect(page.locator(".viewfinder-counts")).to_contain_text("targets left")
    changes(page, page.evaluate(PICTURE))
    expect(page.locator(".veil")).to_be_hidden()


def test_a_frozen_picture_stays_until_it_is_let_go(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    page.get_by_role("button", name="Freeze").click()
    before = page.evaluate(PICTURE)
    page.wait_for_timeout(1500)
    assert page.evaluate(PICTURE) == before
    expect(page.locator(".veil")).to_be_hidden()
    page.get_by_role("button", name="Freeze").click()
    changes(page, before)


def test_ids_and_residuals_are_drawn_on_demand(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    page.get_by_role("button", name="Freeze").click()
    for name in ("Numbers", "Residuals"):
        before = page.evaluate(PICTURE)
        page.get_by_role("button", name=name).click()
        changes(page, before)
    expect(page.get_by_text("up to 0.15 px")).to_be_visible()


def test_each_view_says_how_many_targets_it_shows_and_how_large(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    for view in ("left", "right"):
        facts = page.locator(f'[data-view="{view}"]')
        expect(facts).to_contain_text("px")
        assert int(facts.locator("dd").first.inner_text()) > 20


def test_it_is_grey_and_comes_from_every_field_that_is_taken(daemon: Daemon, open_page: Open) -> None:
    """Many grey values, which bits do not have; a change of the choice shows at once."""
    page = live(daemon, open_page)
    until(page, f"() => ({LEVELS})() > 20")  # the field as it was measured comes first
    page.get_by_role("button", name="As measured").click()
    until(page, f"() => ({LEVELS})() <= 2")
    page.get_by_role("button", name="As measured").click()
    until(page, f"() => ({LEVELS})() > 20")


def test_what_is_clipped_is_tinted_and_counted_in_words(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    assert page.evaluate(TINTED) == 0
    page.get_by_role("button", name="Exposure").click()
    until(page, f"() => ({TINTED})() > 100")  # the simulator's stamp
    expect(page.locator(".legend-white")).to_contain_text("pixels as bright as the camera gets")
    page.get_by_role("button", name="Exposure").click()
    until(page, f"() => ({TINTED})() === 0")


def test_one_looks_closer_by_button_wheel_keys_and_double_tap_and_only_that_part_is_sent(
    daemon: Daemon, open_page: Open
) -> None:
    page = live(daemon, open_page)
    asked: list[Any] = []

    def hear(text: str | bytes) -> None:
        asked.append(text)  # playwright marks its listeners, which a method of a list does not allow

    page.on("websocket", lambda socket: socket.on("framesent", hear))
    page.reload()
    canvas = page.locator(".picture-canvas")
    shows_targets(page)
    assert part_of(asked) is None

    page.get_by_role("button", name="Zoom in").click()
    wait_for_part(page, asked, lambda part: part is not None and part["columns"] < 500)
    whole = page.get_by_role("button", name="Whole picture")
    whole.click()
    wait_for_part(page, asked, lambda part: part is None)

    canvas.focus()
    page.keyboard.press("+")
    page.keyboard.press("+")
    wait_for_part(page, asked, lambda part: part is not None and part["columns"] < 300)
    before = part_of(asked)
    page.keyboard.press("ArrowRight")
    wait_for_part(page, asked, lambda part: part != before)
    page.keyboard.press("0")
    wait_for_part(page, asked, lambda part: part is None)

    canvas.hover(position={"x": 100, "y": 100})
    page.mouse.wheel(0, -400)
    wait_for_part(page, asked, lambda part: part is not None)
    expect(whole).to_be_enabled()
    canvas.dblclick(position={"x": 100, "y": 100})
    wait_for_part(page, asked, lambda part: part is None)
    expect(whole).to_be_disabled()


def part_of(asked: list[Any]) -> dict[str, int] | None:
    """The part of the frame that the page asked for last."""
    asks = [json.loads(text)["ask"] for text in asked if '"ask"' in text]
    part: dict[str, int] | None = asks[-1]["part"]
    return part


def wait_for_part(page: Any, asked: list[Any], told: Callable[[dict[str, int] | None], bool]) -> None:
    for _ in range(200):
        if told(part_of(asked)):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"the page asked for {part_of(asked)}")


def test_two_fingers_look_closer_and_one_moves_that_part(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    asked: list[Any] = []

    def hear(text: str | bytes) -> None:
        asked.append(text)

    page.on("websocket", lambda socket: socket.on("framesent", hear))
    page.reload()
    shows_targets(page)
    canvas = page.locator(".picture-canvas")
    spread(page, canvas)
    wait_for_part(page, asked, lambda part: part is not None and part["columns"] < 400)
    box, before = canvas.bounding_box(), part_of(asked)
    assert before is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    touch(page, ((x, y), (x + 80, y)))
    wait_for_part(page, asked, lambda part: part is not None and part["x"] < before["x"])


def test_nothing_is_sent_to_a_page_that_nobody_sees(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    before = streams_of(daemon)
    page.evaluate(HIDE, True)
    until_streams(page, daemon, lambda count: count < before)
    page.evaluate(HIDE, False)
    until_streams(page, daemon, lambda count: count == before)
    changes(page, page.evaluate(PICTURE))


def streams_of(daemon: Daemon) -> int:
    with urllib.request.urlopen(f"{daemon.url}/metrics", timeout=30) as answer:
        return int(float(re.search(r"^grabberd_streams (\S+)", answer.read().decode(), re.MULTILINE)[1]))


def until_streams(page: Any, daemon: Daemon, told: Callable[[int], bool]) -> None:
    for _ in range(200):
        if told(streams_of(daemon)):
            return
        page.wait_for_timeout(50)
    raise AssertionError(f"there are {streams_of(daemon)} streams")


def test_the_focus_is_a_line_with_its_best_value(daemon: Daemon, open_page: Open) -> None:
    page = live(daemon, open_page)
    for view in ("left", "right"):
        words = page.locator(f'[data-focus="{view}"]')
        expect(words).to_have_text(re.compile(r"view: (now )?0\.\d\d, (best 0\.\d\d|the best so far)"))
    expect(
        page.get_by_role("img", name="the best so far").or_(page.get_by_role("img", name="best 0."))
    ).to_be_visible()
    page.get_by_role("button", name="Reset").click()
    expect(page.locator('[data-focus="left"]')).to_have_text(re.compile(r"0\.\d\d"))


def test_numbers_and_picture_that_are_not_of_now_are_not_shown_as_if_they_were(
    start_daemon: Start, open_page: Open
) -> None:
    daemon = start_daemon(faults=[{"kind": "unplug", "at_s": 2.0, "back_after_s": 6000.0}], idle_slowness=1)
    page = open_page(f"{daemon.url}/#live").page
    expect(page.locator(".veil")).to_contain_text("The grabber was not found")
    expect(page.locator('[data-view="left"] dd').first).to_have_text("–")
    expect(page.locator('[data-focus="left"]')).not_to_contain_text("now 0")
    expect(page.locator(".viewfinder-counts")).to_have_text("Nothing is being measured")


def test_on_a_phone_everything_fits_and_can_be_read(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#live", size=PHONE, look="dark", language="nb").page
    expect(page.locator(".picture-canvas")).to_be_visible()
    until(page, f"() => ({WHITE})() > 50")
    page.get_by_role("button", name="Nærmere").click()
    page.get_by_role("button", name="Eksponering").click()
    assert page.evaluate("document.scrollingElement.scrollWidth <= innerWidth")
    assert serious(page) == []


def test_a_threshold_set_by_hand_is_in_force_until_it_is_chosen_by_itself_again(
    daemon: Daemon, open_page: Open
) -> None:
    page = live(daemon, open_page)
    expect(page.get_by_label("Automatic")).to_be_checked()
    page.get_by_label("Threshold").fill("120")
    until(page, "() => document.querySelector('.aid output').textContent === '120'")
    expect(page.get_by_label("Automatic")).not_to_be_checked()
    _until(page, daemon, "fixed")
    page.get_by_label("Automatic").check()
    _until(page, daemon, "automatic")


def _until(page: Any, daemon: Daemon, kind: str) -> None:
    for _ in range(100):
        if daemon.ask("/settings")["devices"]["simulated"]["threshold"]["kind"] == kind:
            return
        page.wait_for_timeout(100)
    raise AssertionError(f"the threshold is not {kind}")
