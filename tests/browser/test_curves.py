"""The vacuum under the wall's movement, live."""

from playwright.sync_api import expect

from browser.axe import serious
from browser.conftest import PHONE, Open, Start
from browser.daemons import Daemon
from browser.pages import until

DRAWN = """() => {
    const drawn = [...document.querySelectorAll('.curves canvas')].map((canvas) => {
        const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
        let coloured = 0;
        for (let i = 0; i < data.length; i += 4) {
            coloured += data[i + 3] > 200 && Math.max(data[i], data[i + 1], data[i + 2])
                - Math.min(data[i], data[i + 1], data[i + 2]) > 60;
        }
        return coloured;
    });
    return drawn.length === 2 && drawn.every((coloured) => coloured > 50);
}"""
UNPLUGGED = [{"kind": "unplugged", "at_s": 2.0, "for_s": 1e6}]


def test_it_moves_under_the_wall_on_one_axis_of_time(start_daemon: Start, open_page: Open) -> None:
    daemon = start_daemon(loggers=True, idle_slowness=1)
    for panel, look, language, words in (
        ("operate", "light", "en", "Vacuum kPa Pulsation chamber: last"),
        ("live", "dark", "nb", "Vakuum kPa Pulsrommet: siste"),
    ):
        size = PHONE if panel == "operate" else None
        options = {"look": look, "language": language, **({"size": size} if size else {})}
        page = open_page(f"{daemon.url}/#{panel}", **options).page
        until(page, DRAWN)
        expect(page.get_by_role("img", name=words)).to_be_visible()
        expect(page.locator(".curves h2")).to_have_count(2)
        expect(page.locator(".curves .note")).to_have_count(0)
        assert page.evaluate("document.scrollingElement.scrollWidth <= innerWidth")
        assert serious(page) == []


def test_a_logger_that_gives_nothing_is_named_there_with_the_reason(
    start_daemon: Start, open_page: Open
) -> None:
    daemon = start_daemon(loggers=True, logger_faults=UNPLUGGED, idle_slowness=1)
    page = open_page(f"{daemon.url}/#operate").page
    expect(page.locator(".curves .note")).to_contain_text("Logger vacuum sends no readings: ")
    expect(page.locator(".curves .note")).to_contain_text("unplugged")


def test_without_a_logger_there_is_nothing(daemon: Daemon, open_page: Open) -> None:
    page = open_page(f"{daemon.url}/#operate").page
    expect(page.locator(".picture-canvas")).to_be_visible()
    expect(page.locator(".curves")).to_be_hidden()
    assert page.locator(".curves canvas").count() == 0
