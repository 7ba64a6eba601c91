"""A real browser before a real daemon: Debian's Chromium, headless, and the daemon in its own process."""

import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest

from browser.daemons import Daemon
from browser.pages import PATIENCE_MS, TABLET, Watched

CHROMIUM = os.environ.get("GRABBERD_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
HERE = Path(__file__).parent
__all__ = ["CHROMIUM", "PHONE", "TABLET", "Guarded", "Open", "Start"]
PHONE = {"width": 390, "height": 844}

# The locator that takes least of the processor: the page shows alike whatever any of them has found.
CHEAP = "centroid"

Open = Callable[..., Watched]
Start = Callable[..., Daemon]


class Guarded(NamedTuple):
    """A daemon with a token for every role."""

    url: str
    tokens: dict[str, str]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Without a browser the tests that need one say so.

    Workers get the long files first, so that they end at about the same time.
    """
    missing = _missing()
    own = [item for item in items if HERE in item.path.parents]
    tests = Counter(item.path for item in own)
    slow = Counter(item.path for item in own if item.get_closest_marker("slow"))
    for item in own:
        item.add_marker(pytest.mark.timeout(600))
        if missing and "browser" in getattr(item, "fixturenames", ()):
            item.add_marker(pytest.mark.skip(reason=missing))
    ordered = iter(sorted(own, key=lambda item: (slow[item.path], tests[item.path]), reverse=True))
    items[:] = [next(ordered) if HERE in item.path.parents else item for item in items]


def _missing() -> str:
    if CHROMIUM is None:
        return "Chromium is missing: sudo apt-get install chromium"
    try:
        import playwright  # noqa: F401, PLC0415
    except ImportError:
        return "playwright is missing: pip install -e '.[test]'"
    return ""


# Scope "package" is this folder: a worker that goes on to another one leaves nothing running behind itself.
@pytest.fixture(scope="package")
def browser() -> Iterator[object]:
    """Chromium; it ends with this folder, since tests elsewhere must not find playwright's event loop."""
    from playwright.sync_api import expect, sync_playwright  # noqa: PLC0415

    expect.set_options(timeout=PATIENCE_MS)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(
            executable_path=CHROMIUM, args=["--no-sandbox"], timeout=PATIENCE_MS
        )
        yield chromium
        chromium.close()


@pytest.fixture(scope="package")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """One without tokens. Tests share it: they find captures of others there, and leave it ready."""
    with Daemon(tmp_path_factory.mktemp("daemon"), location=CHEAP) as one:
        one.wait_until_it_streams()
        yield one


@pytest.fixture(scope="package")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Guarded]:
    """One that asks for a token, for tests that only look."""
    with Daemon(tmp_path_factory.mktemp("guarded"), location=CHEAP) as one:
        yield Guarded(one.url, {role: one.add_token(role, role) for role in ("viewer", "operator")})


@pytest.fixture(scope="package")
def unplugged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """One whose grabber is pulled out after ten fields, and stays away."""
    faults = [{"kind": "unplug", "at_s": 0.2, "back_after_s": 6000.0}]
    with Daemon(tmp_path_factory.mktemp("unplugged"), location=CHEAP, faults=faults) as one:
        yield one


@pytest.fixture
def start_daemon(tmp_path: Path) -> Iterator[Start]:
    """Starts a daemon for one test: `start_daemon(scene="blank")`. It ends after the pages of the test."""
    with ExitStack() as started:
        yield lambda **options: started.enter_context(Daemon(tmp_path, **{"location": CHEAP, **options}))


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
