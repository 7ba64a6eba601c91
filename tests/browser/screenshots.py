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
LONG_MS = 600_000
FRAME = "calibration_frame"
ORDERS: dict[str, dict[str, Any]] = {
    "liner": {"labels": {"cow": "112", "teat": "front left", "liner": "A"}, "note": "new liners"},
    FRAME: {"bits": 8},
}
LOOKS: dict[str, tuple[dict[str, int], str]] = {
    "tablet": (TABLET, "light"),
    "dark": (TABLET, "dark"),
    "phone": (PHONE, "light"),
}


def as_it_is(_: Any) -> None:
    """Nothing has to be done before the picture."""


class Shot(NamedTuple):
    """A panel: its address, in which `{capture}` is the id of a capture, what is done before, and what stands
    before the camera.
    """

    hash: str
    prepare: Callable[[Any], None] = as_it_is
    full: bool = False
    scene: str = "liner"


def with_numbers(page: Any) -> None:
    page.get_by_role("button", name="Numbers").click()


def while_it_is_closed(page: Any) -> None:
    """A target in the middle of the liner is chosen, and the moment when it has come far."""
    page.locator("#scene-target").select_option("51")
    moved = page.locator(".scene-inspector dd").nth(3)
    for n in range(0, 60, 5):
        page.get_by_role("slider", name="Moment").fill(str(n))
        if float(moved.inner_text().split()[0]) > 3:
            break
    page.locator("h1").click()


def after_a_while(page: Any) -> None:
    page.wait_for_timeout(3 * SETTLED_MS)


def when_found(page: Any) -> None:
    page.locator(".target-picture").first.wait_for(timeout=LONG_MS)
    page.wait_for_timeout(SETTLED_MS)


def to_the_verdict(page: Any) -> None:
    """Computes the calibration, the first time; then it is there."""
    made = page.get_by_role("link", name="Read the result")
    if not made.is_visible():
        page.get_by_role("button", name="Compute").click()
        page.locator("[data-verdict]").wait_for(timeout=LONG_MS)
    else:
        made.click()
        page.locator("[data-verdict]").wait_for()


def beside_another(page: Any) -> None:
    order = {"method": "POST", "headers": {"Content-Type": "application/json"}, "body": '{"fields": 150}'}
    page.evaluate("(order) => fetch('/api/v1/captures', order)", order)
    page.wait_for_timeout(3 * SETTLED_MS)
    page.reload()
    page.get_by_label("Second capture").select_option(index=1)
    page.locator(".compare-facts").wait_for()


def to_the_maps(page: Any) -> None:
    """The first of the pictures asks for the analysis that they all show."""
    if not page.locator("[data-analysis]").count():
        page.get_by_label("Counted from").select_option("nominal")
        page.get_by_role("button", name="Analyse").click()
    page.locator(".map-cell").first.wait_for(timeout=300_000)


SHOTS = {
    "operate": Shot("operate"),
    "live": Shot("live", with_numbers),
    "shape": Shot("shape/{capture}", while_it_is_closed),
    "shape-live": Shot("shape"),
    "plots": Shot("plots", after_a_while),
    "plots-capture": Shot("plots/{capture}"),
    "captures": Shot("captures"),
    "capture": Shot("captures/{capture}", full=True),
    "compare": Shot("compare/{capture}", beside_another, full=True),
    "analysis": Shot("analysis/{capture}", to_the_maps, full=True),
    "calibration": Shot("calibration", full=True),
    "calibration-place": Shot("calibration/place", full=True, scene=FRAME),
    "calibration-found": Shot("calibration/found/{capture}", when_found, full=True, scene=FRAME),
    "calibration-review": Shot("calibration/adjust/{capture}", to_the_verdict, full=True, scene=FRAME),
}


def take(folder: Path, names: list[str]) -> None:
    """Takes the pictures of these names, or all."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = {name: SHOTS[name] for name in names or SHOTS}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for scene in sorted({shot.scene for shot in wanted.values()}, reverse=True):
            shots = {name: shot for name, shot in wanted.items() if shot.scene == scene}
            _take_scene(browser, scene, shots, folder)


def _take_scene(browser: Any, scene: str, shots: dict[str, Shot], folder: Path) -> None:
    with tempfile.TemporaryDirectory() as state, Daemon(Path(state), scene=scene) as daemon:
        capture = daemon.capture(fields=150, **ORDERS[scene])
        for name, shot in shots.items():
            for look in LOOKS:
                address = f"{daemon.url}/#{shot.hash.format(capture=capture)}"
                _take(browser, address, shot, look, folder / f"{name}-{look}.png")


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
