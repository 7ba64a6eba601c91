"""What answers at once, and what is not lost: panels that are still loading, and what was typed."""

from playwright.sync_api import Page, Route, expect

from browser.conftest import PHONE, Open, Start
from browser.daemons import Daemon
from browser.pages import until

SHOWN_AFTER_MS = """([link]) => new Promise((resolve) => {
    const begin = performance.now();
    link.click();
    const look = () => {
        if (document.querySelector('main [aria-busy]')) resolve(performance.now() - begin);
        else setTimeout(look, 5);
    };
    look();
})"""


def test_a_tab_that_is_still_loading_shows_nothing_of_the_panel_before(
    open_page: Open, daemon: Daemon
) -> None:
    """The module comes later, as over a slow link."""
    page: Page = open_page(daemon.url).page
    page.locator(".panel-operate h1, .panel-operate .state-card").first.wait_for()
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/panels/tests.js", hold)
    shown_ms = page.evaluate(SHOWN_AFTER_MS, [page.locator(".nav-link[href='#tests']").element_handle()])
    assert shown_ms < 100
    assert page.locator(".panel-operate").count() == 0
    for _ in range(200):  # the page may have answered before its request is told here
        if held:
            break
        page.wait_for_timeout(50)
    held[0].continue_()
    page.locator(".panel-tests").wait_for()
    assert page.locator("main [aria-busy]").count() == 0


def test_an_instrument_without_captures_shows_the_way_to_the_first_one(
    open_page: Open, start_daemon: Start
) -> None:
    daemon = start_daemon()
    page: Page = open_page(daemon.url, size=PHONE).page
    for step in ("picture", "calibration"):
        page.locator(f"[data-step='{step}'][data-done='true']").wait_for()
    last = page.locator("[data-step='capture'][data-done='false']")
    assert "First capture: press Start" in last.inner_text()
    page.locator("[data-step='picture'] a").click()
    page.locator(".panel-live").wait_for()
    page.go_back()
    page.locator("[data-step='capture']").wait_for()
    daemon.wait_until_sealed(daemon.capture())
    page.reload()
    page.locator(".last .last-facts").wait_for()
    assert page.locator("[data-step]").count() == 0


def test_what_was_typed_survives_another_panel_a_lost_link_and_a_reload(
    open_page: Open, daemon: Daemon
) -> None:
    capture = daemon.capture(5)
    opened = open_page(f"{daemon.url}#captures/{capture}")
    page: Page = opened.page
    cow, note = page.locator("[data-label='cow']"), page.locator(".panel-capture textarea")
    cow.fill("112")
    note.fill("kicked the cup off")
    page.locator(".nav-link[href='#live']").click()
    page.locator(".panel-live").wait_for()
    page.go_back()
    assert (cow.input_value(), note.input_value()) == ("112", "kicked the cup off")
    opened.expect_errors("Failed to load resource", "ERR_")
    page.route("**/api/v1/captures/*", lambda route: route.abort())
    page.locator("[data-do='save']").click()
    expect(page.get_by_text("The instrument is not responding.")).to_be_visible()
    page.unroute("**/api/v1/captures/*")
    page.reload()
    assert (cow.input_value(), note.input_value()) == ("112", "kicked the cup off")
    page.locator("[data-do='save']").click()
    until(page, "() => !Object.keys(sessionStorage).some((key) => key.includes('draft'))")
    assert daemon.ask(f"/captures/{capture}")["labels"]["cow"] == "112"


def test_a_profile_that_was_begun_is_still_there_until_it_is_discarded(
    open_page: Open, daemon: Daemon
) -> None:
    page: Page = open_page(f"{daemon.url}#profiles/liner").page
    text = page.locator("#profile-text")
    beginning = text.input_value()
    text.fill("kind: liner\nname: begun\n")
    page.reload()
    assert text.input_value() == "kind: liner\nname: begun\n"
    page.locator("[data-do='discard']").click()
    assert text.input_value() == beginning


def test_a_part_whose_modules_do_not_come_says_so_and_leaves_the_rest_usable(
    daemon: Daemon, open_page: Open
) -> None:
    watched = open_page(f"{daemon.url}/#captures")
    watched.expect_errors("Failed to fetch", "ERR_FAILED", "Failed to load resource")
    page = watched.page
    page.route("**/live/viewfinder.js", lambda route: route.abort())
    page.evaluate("location.hash = 'operate'")
    page.reload()
    expect(page.locator(".viewfinder").get_by_role("button", name="Reload the page")).to_be_visible()
    expect(page.get_by_role("button", name="Start")).to_be_enabled()


def test_a_panel_whose_texts_do_not_come_says_so(daemon: Daemon, open_page: Open) -> None:
    """As after an upgrade of the daemon, whose files have other addresses."""
    watched = open_page(f"{daemon.url}/#operate")
    watched.expect_errors("Failed to load resource", "texts en.rest: 404")
    page = watched.page
    gone = {"title": "Not Found", "status": 404}
    page.route("**/texts/en.rest.json", lambda route: route.fulfill(status=404, json=gone))
    page.evaluate("location.hash = 'captures'")
    page.reload()
    expect(page.locator("main").get_by_role("button", name="Reload the page")).to_be_visible()


def test_the_other_panels_are_fetched_before_anybody_asks_for_them(daemon: Daemon, open_page: Open) -> None:
    page = open_page(daemon.url, ahead=True).page
    with page.expect_response("**/panels/calibration.js"):
        expect(page.get_by_role("button", name="Start")).to_be_enabled()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.get_by_role("link", name="Captures").click()
    expect(page.get_by_label("Search")).to_be_visible()
    assert not [url for url in asked if "/captures/" in url and url.endswith(".js")]


def test_a_browser_that_saves_data_fetches_no_panel_before_it_is_asked_for(
    daemon: Daemon, open_page: Open
) -> None:
    page = open_page(daemon.url).page
    page.clock.install()
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.reload()
    expect(page.get_by_role("button", name="Start")).to_be_enabled()
    page.clock.run_for(10_000)
    page.wait_for_timeout(300)
    panels = {url.rsplit("/", 1)[1] for url in asked if "/panels/" in url}
    assert panels == {"index.js", "operate.js"}
