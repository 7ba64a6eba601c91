"""A capture replayed: one playhead for picture, shape, curves and map."""

import json
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import cv2
import pytest
from playwright.sync_api import Page, Route, expect

from browser.axe import serious
from browser.conftest import CHEAP, PHONE, Open, Start
from browser.daemons import Daemon
from browser.pages import until

DRAWN_ANEW = """() => {
    const strip = document.querySelector('.strip-picture');
    strip.replaceChildren(...[...strip.children].map((one) => one.cloneNode()));
}"""
HELD = "**/api/v1/captures/*/replay/*"
LOSSES = [{"at_field": n, "kind": "lose", "count": 3} for n in range(100, 60_000, 100)]
NO_WEBGL = """
  const get = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : get.call(this, kind, ...rest);
  };
"""
LOOPING = """() => {
  const said = document.querySelector('.replay-state').innerText;
  return said.includes('Looping fields') && said;
}"""
COUNT_FRAMES = """() => {
  const ask = window.requestAnimationFrame;
  window.frames_asked = 0;
  window.requestAnimationFrame = (draw) => { window.frames_asked += 1; return ask(draw); };
}"""
BRIGHT = """() => {
  const canvas = document.querySelector('.replay-picture');
  if (!canvas) return 0;
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let count = 0;
  for (let i = 0; i < data.length; i += 4) if (data[i] + data[i + 1] + data[i + 2] > 600) count += 1;
  return count;
}"""


@pytest.fixture(scope="module")
def capture(daemon: Daemon) -> str:
    """Id of a capture of some pulsations, with an analysis."""
    capture_id = daemon.capture(fields=120, labels={"cow": "112"})
    daemon.analyse(capture_id, reference="nominal", plane="symmetry")
    return capture_id


@pytest.fixture(scope="module")
def lossy(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon whose grabber loses fields; those who share it look at captures of their own."""
    with Daemon(tmp_path_factory.mktemp("lossy"), location=CHEAP, faults=LOSSES) as one:
        yield one


def replayed(open_page: Open, daemon: Daemon, address: str, **options: object) -> Page:
    """The room, once the picture is there."""
    page: Page = open_page(f"{daemon.url}/#{address}", **options).page
    until(page, BRIGHT)
    return page


def stands_at(page: Page, n: int) -> None:
    """All panes show this field, or say that they do not."""
    words = f"Field {n}, {n / 50:.2f} s"
    expect(page.locator(".replay-when")).to_have_text(words)
    expect(page.locator(".replay-of").first).to_have_text(words)
    expect(page.locator("#scene-summary")).to_contain_text(f"{words}.")


def test_one_playhead_moves_picture_shape_curves_and_map(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = replayed(open_page, daemon, f"replay/{capture}/60")
    stands_at(page, 60)
    page.keyboard.press("ArrowRight")
    stands_at(page, 61)
    expect(page.locator("[data-pane=map] .replay-of")).to_have_text("Field 61")
    page.get_by_role("slider", name="Which field").fill("100")
    stands_at(page, 100)
    curve = page.locator(".replay-chart .u-over").first
    curve.click(position={"x": curve.bounding_box()["width"] * 0.25, "y": 20})
    stands_at(page, 30)
    until(page, "address => location.hash === address", f"#replay/{capture}/30")
    page.reload()
    until(page, BRIGHT)
    stands_at(page, 30)
    page.get_by_label("Which curve").select_option("z")
    page.locator("[data-pane=curves]").get_by_label("Target", exact=True).select_option("51")
    expect(page.locator("[data-pane=curves] .chart h2")).to_have_text("Z of the target mm")
    page.get_by_label("What is shown").select_option("strain1")
    expect(page.locator("[data-pane=map] .scene-legend-title")).to_have_text("Greater principal strain, %")
    page.get_by_text("Turn, colour, choose").click()
    page.get_by_label("Coloured by").select_option("strain1")
    expect(page.locator("[data-pane=wall] .scene-legend-title")).to_have_text("Greater principal strain, %")
    assert serious(page) == []


def test_it_plays_loops_a_pulsation_and_asks_for_nothing_while_it_stands(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = replayed(open_page, daemon, f"replay/{capture}/60")
    page.get_by_role("radio", name="¼").check()
    page.get_by_role("button", name="Play").click()
    until(page, "() => Number(document.querySelector('.replay-transport .slider').value) > 70")
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Loop a pulsation").click()
    looping = page.wait_for_function(LOOPING).json_value()  # at once: it may be fetching a moment later
    first, last = map(int, re.findall(r"\d+", looping))
    assert 45 <= last - first + 1 <= 55
    begins = "first => Number(document.querySelector('.replay-transport .slider').value) <= first + 5"
    page.get_by_role("radio", name="1", exact=True).check()
    until(page, begins, first)
    page.get_by_role("button", name="Pause").click()
    page.wait_for_timeout(500)
    page.evaluate(COUNT_FRAMES)
    page.wait_for_timeout(1000)
    assert page.evaluate("window.frames_asked") == 0


def test_marks_are_set_named_shown_found_and_removed(daemon: Daemon, capture: str, open_page: Open) -> None:
    page = replayed(open_page, daemon, f"replay/{capture}/40")
    page.get_by_label("Name of the mark").fill("kick")
    page.reload()
    until(page, BRIGHT)
    page.get_by_role("button", name="Mark this field").click()
    expect(page.locator(".chart-flag")).to_have_text("kick")
    assert daemon.ask(f"/captures/{capture}")["marks"] == [{"n": 40, "name": "kick"}]
    page.keyboard.press("Tab")
    page.get_by_role("slider", name="Which field").fill("90")
    page.get_by_role("button", name="0.80 s · kick (field 40)").click()
    stands_at(page, 40)
    page.get_by_role("button", name="Remove the mark kick").click()
    expect(page.locator(".chart-flag")).to_have_count(0)
    assert daemon.ask(f"/captures/{capture}")["marks"] == []


def test_a_film_has_every_field_at_its_time(
    daemon: Daemon, capture: str, open_page: Open, tmp_path: Path
) -> None:
    page = replayed(open_page, daemon, f"replay/{capture}/60")
    page.get_by_text("Save as a film").click()
    page.get_by_label("First field").fill("60")
    page.get_by_label("Last field").fill("71")
    page.get_by_label("Speed").last.select_option("0.25")
    with page.expect_download() as download:
        page.get_by_role("button", name="Make the film").click()
    download.value.save_as(tmp_path / "film.webm")
    film = cv2.VideoCapture(str(tmp_path / "film.webm"))
    pictures, times = [], []
    while (read := film.read())[0]:
        pictures.append(read[1])
        times.append(round(film.get(cv2.CAP_PROP_POS_MSEC)))
    assert times == [80 * i for i in range(12)]
    assert all(abs(one.astype(int) - other).max() > 60 for one, other in pairwise(pictures))


def test_a_phone_shows_one_pane_at_a_time(daemon: Daemon, capture: str, open_page: Open) -> None:
    page = replayed(open_page, daemon, f"replay/{capture}/60", size=PHONE, language="nb", look="dark")
    for name in ("Form", "Kurver", "Kart", "Bilde"):
        page.get_by_role("radio", name=name).check()
        shown = page.locator(".replay-pane:visible")
        expect(shown).to_have_count(1)
        expect(shown).to_have_attribute("aria-label", name)
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert serious(page) == []


def test_addresses_of_the_earlier_pages_lead_to_the_room(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = open_page(f"{daemon.url}/#operate").page
    for old in ("shape/{}", "plots/{}", "plots/{}/51"):
        page.goto(f"{daemon.url}/#{old.format(capture)}")
        until(page, "address => location.hash.startsWith(address)", f"#replay/{capture}/")
    page.goto(f"{daemon.url}/#captures/{capture}")
    page.locator(".strip-picture").hover()
    page.mouse.down()
    page.evaluate(DRAWN_ANEW)  # as by any change that the daemon tells of
    page.mouse.up()
    until(page, "address => location.hash === address", f"#replay/{capture}/60")


def test_a_slow_link_makes_the_playhead_wait_and_say_so(
    daemon: Daemon, capture: str, open_page: Open
) -> None:
    page = replayed(open_page, daemon, f"replay/{capture}/10")
    held: list[Route] = []
    slow = True

    def answer(route: Route) -> None:
        if slow:
            held.append(route)
        else:
            route.continue_()

    page.route(HELD, answer)
    page.reload()
    expect(page.locator(".picture-missing")).to_have_text("Loading the picture of field 10 …")
    page.get_by_role("button", name="Play").click()
    expect(page.locator(".replay-state")).to_contain_text("Waiting for the fields")
    stands = page.get_by_role("slider", name="Which field").input_value()
    slow = False
    for route in held:
        route.continue_()
    until(
        page,
        "before => Number(document.querySelector('.replay-transport .slider').value) > before",
        int(stands),
    )
    expect(page.locator(".replay-state")).not_to_contain_text("Waiting")


def test_a_lost_field_a_broken_part_and_a_damaged_capture_are_told(lossy: Daemon, open_page: Open) -> None:
    one = lossy.capture(fields=120)
    lost = lossy.ask(f"/captures/{one}")["ledger"]["entries"][0]["first_n"]
    watched = open_page(f"{lossy.url}/#replay/{one}/{lost}")
    watched.expect_errors("410")
    page = watched.page
    expect(page.locator(".picture-missing")).to_contain_text("This field was lost")
    assert page.evaluate(BRIGHT) == 0
    broken = json.dumps({"detail": "the disk has changed it", "hint": ""})
    page.route("**/replay/pictures*", lambda route: route.fulfill(status=410, body=broken))
    page.reload()
    page.get_by_role("slider", name="Which field").fill("10")
    expect(page.locator(".picture-missing")).to_contain_text("cannot be read: the disk has changed it")
    expect(page.locator("#scene-summary")).to_contain_text("Field 10, 0.20 s")
    file = lossy.folder / "captures" / f"{one}.grab"
    file.write_bytes(b"nothing that SQLite knows" * 100)
    page.reload()
    expect(page.locator(".note.is-bad")).to_contain_text("damaged and cannot be replayed")


def test_what_is_being_recorded_is_replayed_as_far_as_it_is_stored(lossy: Daemon, open_page: Open) -> None:
    lossy.wait_until_it_streams()
    running = lossy.ask("/captures", body={})["id"]
    page = open_page(f"{lossy.url}/#replay/{running}").page
    expect(page.get_by_text("still being recorded")).to_be_visible()
    until(page, BRIGHT)
    most = "() => Number(document.querySelector('.replay-transport .slider').max)"
    before = page.evaluate(most)
    until(page, f"before => ({most})() > before", before)
    lossy.ask(f"/captures/{running}/stop", body={})
    expect(page.get_by_text("still being recorded")).to_have_count(0)


def test_without_webgl_and_where_no_target_was_seen_it_says_so(start_daemon: Start, open_page: Open) -> None:
    other = start_daemon(scene="blank")
    blank = other.capture(fields=10)
    page = open_page(f"{other.url}/#replay/{blank}").page
    expect(page.locator("#scene-summary")).to_contain_text("0 of 108 targets")
    expect(page.locator("[data-pane=curves]")).to_contain_text("It was not measured here")
    expect(page.locator("[data-pane=map]")).to_contain_text("not analysed yet")
    page.context.add_init_script(NO_WEBGL)
    page.reload()
    expect(page.locator("[data-pane=wall]")).to_contain_text("WebGL 2 is missing")
