"""What the page weighs, how soon it is seen, and what it costs the daemon to be looked at."""

import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.web import Files

VISITS = 10
CLIENTS = 2
SETTLE_S = 5.0
OVER_S = 20.0
PATIENCE_S = 60.0
READY = "[data-panel]"
FIRST_PAINT = "performance.getEntriesByName('first-contentful-paint')[0].startTime"
FETCHED = (
    "performance.getEntriesByType('resource').concat(performance.getEntriesByType('navigation'))"
    ".reduce((sum, one) => sum + one.encodedBodySize, 0)"
)
TABLET = {"width": 1024, "height": 768}


class Host(NamedTuple):
    """A daemon in a process of its own."""

    url: str
    pid: int


class Visit(NamedTuple):
    """What a browser that knew nothing saw."""

    first_paint_ms: float
    fetched_bytes: int


def table() -> str:
    """The figures as a Markdown table."""
    return "\n".join(["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in _rows())])


def _rows() -> Iterator[tuple[str, str]]:
    yield "every file of the page, compressed (goal: 400 kB)", f"{weight_bytes() / 1000:.0f} kB"
    chromium = _chromium()
    if chromium is None:
        yield "all else", "not measured: Chromium is missing, sudo apt-get install chromium"
    else:
        yield from _shown_by(chromium)


def _shown_by(chromium: str) -> Iterator[tuple[str, str]]:
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - only this part needs it

    with (
        tempfile.TemporaryDirectory() as folder,
        _daemon(Path(folder)) as host,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        try:
            yield from _seen(browser, host)
        finally:
            browser.close()


def weight_bytes() -> int:
    """All that the page may ever ask for, but for the other language and the parts that are joined."""
    files = Files().edition.files
    joined = {name for name in files if name.startswith(("css/", "texts/en/", "texts/nb/"))}
    needed = {name for name in files if not name.endswith((".txt", ".md", "nb.json"))} - joined
    return sum(len(files[name].compressed) for name in needed)


def _seen(browser: Any, host: Host) -> Iterator[tuple[str, str]]:
    visits = [_visit(browser, host) for _ in range(VISITS)]
    paints = [one.first_paint_ms for one in visits]
    yield "of it fetched for the first sight", f"{visits[0].fetched_bytes / 1000:.0f} kB"
    yield (
        f"first paint on loopback, median of {VISITS} (goal: 500 ms)",
        f"{statistics.median(paints):.0f} ms, {min(paints):.0f} to {max(paints):.0f}",
    )
    nobody = _share(host, OVER_S)
    yield "share of a core, nobody looks", f"{nobody:.1%}"
    for panel in ("operate", "live"):
        share = _looked_at(browser, host, panel)
        more = f"{share - nobody:+.1%}"
        yield f"{CLIENTS} clients with the live picture, {panel} (goal: +10 %)", f"{share:.1%}: {more}"


def _visit(browser: Any, host: Host) -> Visit:
    with _page(browser, host, "operate") as page:
        page.wait_for_load_state("load")
        return Visit(page.evaluate(FIRST_PAINT), page.evaluate(FETCHED))


def _looked_at(browser: Any, host: Host, panel: str) -> float:
    with _page(browser, host, panel), _page(browser, host, panel):
        time.sleep(SETTLE_S)
        return _share(host, OVER_S)


@contextmanager
def _page(browser: Any, host: Host, panel: str) -> Iterator[Any]:
    context = browser.new_context(viewport=TABLET)
    page = context.new_page()
    page.goto(f"{host.url}/#{panel}")
    page.wait_for_selector(READY)
    yield page
    context.close()


def _share(host: Host, seconds: float) -> float:
    """Of a core, that the daemon used; what it takes in threads of its own counts too."""
    before_s, began_s = _used_s(host.pid), time.monotonic()
    time.sleep(seconds)
    return (_used_s(host.pid) - before_s) / (time.monotonic() - began_s)


def _used_s(pid: int) -> float:
    user, system = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


@contextmanager
def _daemon(folder: Path) -> Iterator[Host]:
    """As it is delivered, on the simulated grabber; ready once this begins."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    environment = os.environ | {"STATE_DIRECTORY": str(folder), "OPENBLAS_NUM_THREADS": "1"}
    command = [str(Path(sys.executable).with_name("grabberd")), "serve", "--port", str(port)]
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, env=environment, stdout=quiet, stderr=quiet) as process:
        try:
            _wait_until_ready(f"http://127.0.0.1:{port}/readyz")
            time.sleep(SETTLE_S)
            yield Host(f"http://127.0.0.1:{port}", process.pid)
        finally:
            process.terminate()


def _wait_until_ready(url: str) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        with suppress(OSError), urllib.request.urlopen(url, timeout=PATIENCE_S):
            return
        time.sleep(0.2)
    raise TimeoutError(f"{url} did not become ready within {PATIENCE_S:g} s")


def _chromium() -> str | None:
    named = os.environ.get("GRABBERD_CHROMIUM")
    return named or shutil.which("chromium") or shutil.which("chromium-browser")
