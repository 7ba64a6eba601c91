"""Pictures of every panel, light, dark and on a phone, for docs/images/page: `make screenshots`.

python -m browser.screenshots FOLDER [NAME …], with tests/ on the path. What they show
is a real daemon's on the simulated grabber; a capture is taken for them first.
"""

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from playwright.sync_api import sync_playwright

from browser.conftest import CHROMIUM, PHONE, TABLET
from browser.daemons import Daemon

SETTLED_MS = 4000
LOOKS: dict[str, tuple[dict[str, int], str]] = {
    "tablet": (TABLET, "light"),
    "dark": (TABLET, "dark"),
    "phone": (PHONE, "light"),
}


def as_it_is(_: Any) -> None:
    """Nothing has to be done before the picture."""


class Shot(NamedTuple):
    """A panel: its address, in which `{capture}` is the id of a capture, and what is done before."""

    hash: str
    prepare: Callable[[Any], None] = as_it_is
    full: bool = False


def with_numbers(page: Any) -> None:
    page.get_by_role("button", name="Numbers").click()


SHOTS = {
    "operate": Shot("operate"),
    "live": Shot("live", with_numbers),
}


def take(folder: Path, names: list[str]) -> None:
    """Takes the pictures of these names, or all."""
    folder.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory() as state,
        Daemon(Path(state)) as daemon,
        sync_playwright() as playwright,
    ):
        labels = {"cow": "112", "teat": "front left", "liner": "A"}
        capture = daemon.capture(fields=150, labels=labels, note="new liners")
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for name in names or SHOTS:
            for look in LOOKS:
                address = f"{daemon.url}/#{SHOTS[name].hash.format(capture=capture)}"
                _take(browser, address, SHOTS[name], look, folder / f"{name}-{look}.png")


def _take(browser: Any, address: str, shot: Shot, look: str, file: Path) -> None:
    size, scheme = LOOKS[look]
    context = browser.new_context(viewport=size, color_scheme=scheme, locale="en-GB", timezone_id="UTC")
    page = context.new_page()
    page.goto(address)
    page.wait_for_selector("[data-panel]")
    page.wait_for_timeout(SETTLED_MS)
    shot.prepare(page)
    page.wait_for_timeout(SETTLED_MS / 4)
    page.screenshot(path=file, full_page=shot.full)
    context.close()
    print(file)


if __name__ == "__main__":
    take(Path(sys.argv[1]), sys.argv[2:])
