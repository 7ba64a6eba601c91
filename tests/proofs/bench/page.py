"""Measures what the page weighs, how soon it is seen, how often it draws, and what it costs the daemon."""

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from typing import Any, NamedTuple

from tests.proofs.bench.page_host import MISSING, READY, SETTLE_S, Host, browsing, chromium, host, page_at

from grabberd.server.web import Files

VISITS = 10
CLIENTS = 2
OVER_S = 20.0
REPLAYED = 1500
"""Fields of the capture that is replayed: half a minute, more than it is looked at."""
DESK = {"width": 1600, "height": 1000}
FIRST_PAINT = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
NOTE_PANEL = """new MutationObserver((_, watching) => {
    if (!document.querySelector("[data-panel]")) return;
    watching.disconnect();
    requestAnimationFrame(() => window.panel_ms = performance.now());
}).observe(document, { childList: true, subtree: true });"""
"""The time when the first panel is drawn."""
FETCHED = """(until_ms) => performance.getEntriesByType("resource")
    .concat(performance.getEntriesByType("navigation"))
    .filter((one) => one.responseEnd <= until_ms)
    .reduce((sum, one) => sum + one.encodedBodySize, 0)"""
WATCH_TASKS = """() => {
    window.longTasks = [];
    const note = (list) => window.longTasks.push(...list.getEntries().map((one) => one.duration));
    new PerformanceObserver(note).observe({ type: "longtask" });
}"""
COUNT_DRAWN = """{
    const drawn = new Map();
    window.drawnBy = drawn;
    const count = (canvas) => {
        const now = document.timeline.currentTime;
        const had = drawn.get(canvas) ?? { times: 0, last: -1 };
        if (had.last !== now) drawn.set(canvas, { times: had.times + 1, last: now });
    };
    const watch = (type, name) => {
        const own = type.prototype[name];
        type.prototype[name] = function (...given) {
            count(this.canvas);
            return own.apply(this, given);
        };
    };
    watch(WebGL2RenderingContext, "clear");
    for (const name of ["drawImage", "putImageData", "clearRect"]) watch(CanvasRenderingContext2D, name);
}"""
"""Counts the refreshes of the screen before which a canvas was drawn on."""
DRAWN = """() => Object.fromEntries([...window.drawnBy].filter(([canvas]) => canvas.isConnected)
    .map(([canvas, { times }]) => [canvas.className || canvas.parentElement.className, times]))"""


class Visit(NamedTuple):
    """What a browser that knew nothing saw: the frame, then the panel in it, then all the rest.

    Attributes:
        paint_ms: when anything was there to be seen.
        panel_ms: when the first panel was.
        panel_bytes: what had been fetched for that, compressed.
        all_bytes: what had been fetched when picture and curves were there, too.
    """

    paint_ms: float
    panel_ms: float
    panel_bytes: int
    all_bytes: int


class Sight(NamedTuple):
    """A part of the page that is looked at, by so many at a time."""

    name: str
    at: str
    clients: int = 1
    press: str | None = None
    size: dict[str, int] | None = None


class Looked(NamedTuple):
    """Pages that are looked at: the daemon's share of a core, and what reaches and is drawn by each of them.

    Attributes:
        share: of a core.
        pictures_hz: pictures that its WebSocket brought.
        kb_s: all that its WebSockets brought.
        drawn_hz: how often each canvas was drawn on, by its class.
        tasks_ms: those that took longer than 50 ms, of all pages.
    """

    share: float
    pictures_hz: float
    kb_s: float
    drawn_hz: dict[str, float]
    tasks_ms: list[float]


def table() -> str:
    """The figures as a Markdown table."""
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in _rows())])


def _rows() -> Iterator[tuple[str, str]]:
    yield "every file of the page, compressed (goal: 400 kB)", f"{weight_bytes() / 1000:.0f} kB"
    executable = chromium()
    if executable is None:
        yield "all else", f"not measured: {MISSING}"
        return
    with host() as daemon, browsing(executable) as browser:
        yield from _first_seen(browser, daemon)
        yield from _looked_at_all(browser, daemon)


def weight_bytes() -> int:
    """All that the page may ever ask for, but for the other language."""
    files = Files().newest().files
    needed = {name for name in files if not name.endswith((".txt", ".md", "nb.json"))}
    return sum(len(files[name].compressed) for name in needed)


def _first_seen(browser: Any, daemon: Host) -> Iterator[tuple[str, str]]:
    visits = [_visit(browser, daemon) for _ in range(VISITS)]
    yield "fetched until the first panel is shown (goal: 80 kB)", f"{visits[0].panel_bytes / 1000:.0f} kB"
    yield "fetched with its picture and its curves", f"{visits[0].all_bytes / 1000:.0f} kB"
    for name, times_ms in (
        ("first paint on loopback (goal: 300 ms)", [one.paint_ms for one in visits]),
        ("first panel on loopback, with Start and Stop", [one.panel_ms for one in visits]),
    ):
        median_ms = statistics.median(times_ms)
        yield (
            f"{name}, median of {VISITS}",
            f"{median_ms:.0f} ms, {min(times_ms):.0f} to {max(times_ms):.0f}",
        )


def _visit(browser: Any, daemon: Host) -> Visit:
    with page_at(browser, f"{daemon.url}/#operate", script=NOTE_PANEL) as page:
        page.wait_for_timeout(1000 * SETTLE_S)
        panel_ms = page.evaluate("window.panel_ms")
        fetched = [page.evaluate(FETCHED, until_ms) for until_ms in (panel_ms, 1000 * SETTLE_S)]
        return Visit(page.evaluate(FIRST_PAINT), panel_ms, *fetched)


def _looked_at_all(browser: Any, daemon: Host) -> Iterator[tuple[str, str]]:
    replay = f"replay/{daemon.capture(REPLAYED)}"
    nobody = _share(daemon, time.sleep)
    yield "share of a core, nobody looks", f"{nobody:.1%}"
    for sight in (
        Sight("the operator's panel", "operate"),
        Sight("the operator's panel", "operate", CLIENTS),
        Sight("the picture", "live"),
        Sight("the picture", "live", CLIENTS),
        Sight("the live shape", "shape"),
        Sight("a replay of four panes", replay, press="Play", size=DESK),
        Sight("a replay, one pane at a time", replay, press="Play", size={"width": 390, "height": 844}),
    ):
        yield from _told(sight, _looked_at(browser, daemon, sight), nobody)


def _told(sight: Sight, seen: Looked, nobody: float) -> Iterator[tuple[str, str]]:
    name = f"{sight.name}, {sight.clients} client{'s' if sight.clients > 1 else ''}"
    yield f"{name}: share of a core (goal: +10 %)", f"{seen.share:.1%}: {seen.share - nobody:+.1%}"
    if seen.pictures_hz:
        yield f"{name}: pictures that reach each page (goal: 25/s)", f"{seen.pictures_hz:.1f}/s"
    if seen.drawn_hz:
        told = ", ".join(f"`{canvas}` {hz:.0f}" for canvas, hz in sorted(seen.drawn_hz.items()))
        yield f"{name}: times a second that each canvas is drawn (goal: 30)", told
    if seen.kb_s > 1:
        yield f"{name}: WebSockets bring each page", f"{seen.kb_s:.0f} kB/s"
    yield (
        f"{name}: tasks of more than 50 ms in each page, in {OVER_S:.0f} s",
        f"{len(seen.tasks_ms) / sight.clients:.0f}, the longest {max(seen.tasks_ms, default=0):.0f} ms",
    )


def _looked_at(browser: Any, daemon: Host, sight: Sight) -> Looked:
    """One or several pages for a while, the means over them."""
    with ExitStack() as stack:
        url = f"{daemon.url}/#{sight.at}"
        pages = [
            stack.enter_context(page_at(browser, url, sight.size, COUNT_DRAWN)) for _ in range(sight.clients)
        ]
        sent = [_Sent(page) for page in pages]
        for page in pages:
            page.reload()  # so that its sockets are opened under our eyes
            page.wait_for_selector(READY)
        pages[0].wait_for_timeout(1000 * SETTLE_S)
        for page in pages:
            page.evaluate(WATCH_TASKS)
            if sight.press:
                page.get_by_role("button", name=sight.press, exact=True).first.click()
        before = [(one.pictures, one.bytes) for one in sent]
        drawn = pages[0].evaluate(DRAWN)
        began_s = time.monotonic()
        share = _share(daemon, lambda seconds: pages[0].wait_for_timeout(1000 * seconds))
        passed_s = time.monotonic() - began_s
        drawn_hz = {
            canvas: (times - drawn.get(canvas, 0)) / passed_s
            for canvas, times in pages[0].evaluate(DRAWN).items()
        }
        pictures = sum(one.pictures - had for one, (had, _) in zip(sent, before, strict=True))
        size = sum(one.bytes - had for one, (_, had) in zip(sent, before, strict=True))
        tasks_ms = [task for page in pages for task in page.evaluate("window.longTasks")]
    each = sight.clients * passed_s
    return Looked(share, pictures / each, size / each / 1000, drawn_hz, tasks_ms)


class _Sent:
    """Counts what a page's WebSockets receive."""

    def __init__(self, page: Any) -> None:
        self.pictures = self.bytes = 0
        page.on(
            "websocket", lambda socket: socket.on("framereceived", lambda frame: self._count(socket, frame))
        )

    def _count(self, socket: Any, frame: str | bytes) -> None:
        self.bytes += len(frame)
        self.pictures += isinstance(frame, bytes) and "/preview" in socket.url


def _share(daemon: Host, wait: Callable[[float], object]) -> float:
    """Of a core, that the daemon used; what it takes in threads of its own counts too."""
    before_s, began_s = daemon.used_s(), time.monotonic()
    wait(OVER_S)
    return (daemon.used_s() - before_s) / (time.monotonic() - began_s)
