"""A daemon as it is delivered and a browser to look at it with, for what is measured of the page."""

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

SETTLE_S = 5.0
PATIENCE_S = 60.0
LOOK_EVERY_S = 0.2
READY = "[data-panel]"
TABLET = {"width": 1024, "height": 768}
MISSING = "Chromium is missing, sudo apt-get install chromium"


class Host(NamedTuple):
    """A daemon in a process of its own."""

    url: str
    pid: int

    def ask(self, path: str, body: Any = None) -> Any:
        """A request below /api/v1, POST if it has a body; the answer's document."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            f"{self.url}/api/v1{path}", data, {"Content-Type": "application/json"}
        )
        with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
            return json.loads(answer.read())

    def used_s(self) -> float:
        """Processor time so far, of all its threads."""
        user, system = Path(f"/proc/{self.pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13]
        return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")

    def capture(self, fields: int, **order: Any) -> str:
        """Takes a capture and returns its id once it is sealed."""
        capture_id: str = self.ask("/captures", {"fields": fields, **order})["id"]
        end_s = time.monotonic() + PATIENCE_S + fields / 50
        while self.ask(f"/captures/{capture_id}")["verdict"] is None:
            if time.monotonic() > end_s:
                raise TimeoutError(f"{capture_id} is not sealed in time")
            time.sleep(LOOK_EVERY_S)
        return capture_id


@contextmanager
def host() -> Iterator[Host]:
    """On the simulated grabber; ready once this begins."""
    with tempfile.TemporaryDirectory() as folder, socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
        free.close()
        environment = os.environ | {"STATE_DIRECTORY": folder, "OPENBLAS_NUM_THREADS": "1"}
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
        time.sleep(LOOK_EVERY_S)
    raise TimeoutError(f"{url} did not become ready within {PATIENCE_S:g} s")


def chromium() -> str | None:
    """Where it is, if there is one."""
    named = os.environ.get("GRABBERD_CHROMIUM")
    return named or shutil.which("chromium") or shutil.which("chromium-browser")


@contextmanager
def browsing(executable: str) -> Iterator[Any]:
    """A browser without a graphics processor."""
    from playwright.sync_api import sync_playwright  # noqa: PLC0415 - only this part needs it

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=executable, args=["--no-sandbox"])
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def page_at(browser: Any, url: str, size: dict[str, int] | None = None, script: str = "") -> Iterator[Any]:
    """A page in a context that knows nothing, once a panel is shown; the script runs before its own."""
    context = browser.new_context(viewport=size or TABLET)
    if script:
        context.add_init_script(script)
    page = context.new_page()
    page.goto(url)
    page.wait_for_selector(READY)
    try:
        yield page
    finally:
        context.close()
