"""Measures what a page holds on to that is open for long: memory, nodes and listeners."""

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from tests.proofs.bench.page_host import MISSING, Host, browsing, chromium, host, page_at

ROUNDS = (1, 5, 10, 20)
STAY_S = 1.0
"""Time in each panel: its first answers and pictures have come."""
LOOKS = (0.1, 0.25, 0.5, 0.75, 1.0)
"""When a page that stays open is looked at, as parts of its time."""
OPEN = "operate"
"""The panel that hangs open in a barn."""
FIELDS = 250
DESK = {"width": 1600, "height": 1000}
PANELS = ("live", "shape", "plots", "captures", "tests", "calibration", "profiles", "compare")


class Held(NamedTuple):
    """What a page holds after its garbage was collected."""

    heap_mb: float
    nodes: int
    listeners: int


def table() -> str:
    """What a page holds that has shown every panel again and again, as a Markdown table."""
    return _table(_rounds)


def table_of_open(seconds: float) -> str:
    """What the operator's page holds that is open for so long, as a Markdown table."""
    return _table(lambda browser, daemon: _stay_open(browser, daemon, seconds))


def _table(rows_of: Callable[[Any, Host], Iterator[tuple[str, Held]]]) -> str:
    executable = chromium()
    if executable is None:
        return f"Not measured: {MISSING}."
    rows = ["| | heap, MB | nodes | listeners |", "|---|---|---|---|"]
    with host() as daemon, browsing(executable) as browser:
        for name, held in rows_of(browser, daemon):
            rows.append(f"| {name} | {held.heap_mb:.2f} | {held.nodes} | {held.listeners} |")
    return "\n".join(rows)


def _rounds(browser: Any, daemon: Host) -> Iterator[tuple[str, Held]]:
    first, second = (daemon.capture(FIELDS) for _ in range(2))
    panels = [*PANELS, f"captures/{first}", f"replay/{first}", f"analysis/{second}", f"replay/{second}"]
    with page_at(browser, f"{daemon.url}/#operate", DESK) as page:
        for turn in range(1, max(ROUNDS) + 1):
            for panel in panels:
                _go(page, panel)
            _go(page, "operate")
            if turn in ROUNDS:
                yield f"every panel shown {turn} times, then the operator's", held_by(page)


def _go(page: Any, panel: str) -> None:
    page.evaluate("(panel) => { location.hash = panel; }", panel)
    page.wait_for_timeout(1000 * STAY_S)


def _stay_open(browser: Any, daemon: Host, seconds: float) -> Iterator[tuple[str, Held]]:
    with page_at(browser, f"{daemon.url}/#{OPEN}", DESK) as page:
        began_s = time.monotonic()
        for part in LOOKS:
            page.wait_for_timeout(1000 * max(0.0, began_s + part * seconds - time.monotonic()))
            yield f"`#{OPEN}` for {part * seconds / 60:.0f} minutes", held_by(page)


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
