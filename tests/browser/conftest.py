"""A real browser before a real daemon: Debian's Chromium, headless, and the daemon in its own process."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from browser.daemons import Daemon
from browser.pages import PATIENCE_MS, TABLET, Watched

CHROMIUM = os.environ.get("GRABBERD_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
HERE = Path(__file__).parent
__all__ = ["CHROMIUM", "PHONE", "TABLET", "Open", "Start"]
PHONE = {"width": 390, "height": 844}

Open = Callable[..., Watched]
Start = Callable[..., Daemon]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Without a browser the tests that need one say so."""
    missing = _missing()
    for item in items:
        if HERE in item.path.parents:
            item.add_marker(pytest.mark.timeout(600))
        if missing and HERE in item.path.parents and "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.skip(reason=missing))


def _missing() -> str:
    if CHROMIUM is None:
        return "Chromium is missing: sudo apt-get install chromium"
    try:
        import playwright  # noqa: F401, PLC0415
    except ImportError:
        return "playwright is missing: pip install -e '.[test]'"
    return ""


@pytest.fixture(scope="module")
def browser() -> Iterator[object]:
    """Chromium, for the tests of a file: playwright's event loop runs on, and no other file may find it."""
    from playwright.sync_api import expect, sync_playwright  # noqa: PLC0415

    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox"], timeout=PATIENCE_MS
        )
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """One without tokens, for the tests of a file."""
    with Daemon(tmp_path_factory.mktemp("daemon")) as one:
        yield one


@pytest.fixture
def start_daemon(tmp_path: Path) -> Iterator[Start]:
    """Starts a daemon for one test: `start_daemon(scene="blank")`. It ends after the pages of the test."""
    with ExitStack() as started:
        yield lambda **options: started.enter_context(Daemon(tmp_path, **options))


@pytest.fixture
def open_page(browser: object, start_daemon: Start) -> Iterator[Open]:
    """Opens a page: `open_page(url, size=PHONE, look="dark", language="nb")`.

    At the end of the test none may have had an error, or asked anything of another host.
    """
    opened: list[Watched] = []

    def open_one(url: str, **options: object) -> Watched:
        opened.append(Watched(browser, url, **options))
        return opened[-1]

    yield open_one
    for one in opened:
        one.close()
    for one in opened:
        one.check()
