"""Measures what a page holds on to that is open for long: memory, nodes and listeners."""

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

from tests.bench.page_host import MISSING, Host, browsing, chromium, host, page_at

ROUNDS = (1, 5, 10, 20)
STAY_S = 1.0
"""Time in each panel: its first answers and pictures have come."""
OPEN_MIN = 4
LOOK_EVERY_MIN = 2
FIELDS = 250
DESK = {"width": 1600, "height": 1000}
PANELS = ("live", "shape", "plots", "captures", "tests", "calibration", "profiles", "compare")


class Held(NamedTuple):
    """What a page holds after its garbage was collected."""

    heap_mb: float
    nodes: int
    listeners: int


def table() -> str:
    """The figures as a Markdown table."""
    executable = chromium()
    if executable is None:
        return f"Not measured: {MISSING}."
    rows = ["| | heap, MB | nodes | listeners |", "|---|---|---|---|"]
    with host() as daemon, browsing(executable) as browser:
        for name, held in _all(browser, daemon):
            rows.append(f"| {name} | {held.heap_mb:.2f} | {held.nodes} | {held.listeners} |")
    return "\n".join(rows)


def _all(browser: Any, daemon: Host) -> Iterator[tuple[str, Held]]:
    captures = [daemon.capture(FIELDS) for _ in range(2)]
    with page_at(browser, f"{daemon.url}/#operate", DESK) as page:
        yield from _rounds(page, captures)
    for panel in ("operate", "live", "shape"):
        with page_at(browser, f"{daemon.url}/#{panel}", DESK) as page:
            yield from _stays_open(page, panel)


def _rounds(page: Any, captures: list[str]) -> Iterator[tuple[str, Held]]:
    first, second = captures
    panels = [*PANELS, f"captures/{first}", f"replay/{first}", f"analysis/{second}", f"replay/{second}"]
    for turn in range(1, max(ROUNDS) + 1):
        for panel in panels:
            _go(page, panel)
        _go(page, "operate")
        if turn in ROUNDS:
            yield f"every panel shown {turn} times, then the operator's", held_by(page)


def _go(page: Any, panel: str) -> None:
    page.evaluate("(panel) => { location.hash = panel; }", panel)
    page.wait_for_timeout(1000 * STAY_S)


def _stays_open(page: Any, panel: str) -> Iterator[tuple[str, Held]]:
    began_s = time.monotonic()
    for minute in range(LOOK_EVERY_MIN, OPEN_MIN + 1, LOOK_EVERY_MIN):
        page.wait_for_timeout(1000 * max(0.0, began_s + 60 * minute - time.monotonic()))
        if minute in (LOOK_EVERY_MIN, OPEN_MIN):
            yield f"`#{panel}` for {minute} minutes", held_by(page)


def held_by(page: Any) -> Held:
    """What the page holds now."""
    devtools = page.context.new_cdp_session(page)
    try:
        devtools.send("Performance.enable")
        devtools.send("HeapProfiler.collectGarbage")
        metrics = devtools.send("Performance.getMetrics")["metrics"]
    finally:
        devtools.detach()
    found = {one["name"]: one["value"] for one in metrics}
    return Held(found["JSHeapUsedSize"] / 1e6, int(found["Nodes"]), int(found["JSEventListeners"]))
