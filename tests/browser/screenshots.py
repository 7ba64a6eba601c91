"""Pictures of every panel, light, dark and on a phone, for docs/images/page: `make screenshots`.

python -m browser.screenshots FOLDER [NAME …], with tests/ on the path. What they show
is a real daemon's on the simulated grabber; a capture is taken for them first.
"""

import io
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from PIL import Image
from playwright.sync_api import sync_playwright

from browser.conftest import CHROMIUM, PHONE, TABLET
from browser.daemons import Daemon
from grabberd.config import shipped_configs

SETTLED_MS = 4000
LONG_MS = 600_000
COLOURS = 256
FRAME = "calibration_frame"
LOOKS: dict[str, tuple[dict[str, int], str]] = {
    "tablet": (TABLET, "light"),
    "dark": (TABLET, "dark"),
    "phone": (PHONE, "light"),
}


class Stage(NamedTuple):
    """A daemon for pictures.

    Attributes:
        options: of its simulated grabber.
        order: of the captures that are taken for the pictures.
        guarded: it asks for a token.
        streams: whether it gets that far.
    """

    options: dict[str, Any]
    order: dict[str, Any] | None = None
    guarded: bool = False
    streams: bool = True


LINER = {"labels": {"cow": "112", "teat": "front left", "liner": "A"}, "note": "new liners"}
STAGES = {
    "liner": Stage({}, {"fields": 150, **LINER}),
    FRAME: Stage({"scene": FRAME}, {"fields": 150, "bits": 8}),
    "guarded": Stage({}, guarded=True),
    "unplugged": Stage({"faults": [{"kind": "unplug", "at_s": 1.0, "back_after_s": 6000.0}]}, streams=False),
}
PROFILE = shipped_configs() / "profiles" / "liner-example-reference.yaml"
TESTED: dict[str, Any] = {
    "fields": 50,
    "bits": 8,
    "labels": {"test": "reference", "liner": "example-reference"},
}
"""A milking is no reference state: its checks say so."""
INPUTS = {"reference": "nominal", "plane": "symmetry"}


def as_it_is(_: Any) -> None:
    """Nothing has to be done before the picture."""


class Shot(NamedTuple):
    """A panel: its address, what is done before, and which daemon it is of.

    In the address `{capture}` is the id of a capture, `{analysed}` and `{other}` those of two that have been
    analysed, and `{tested}` that of a guided test.
    """

    hash: str
    prepare: Callable[[Any], None] = as_it_is
    full: bool = False
    stage: str = "liner"
    language: str = "en-GB"


def with_numbers(page: Any) -> None:
    page.get_by_role("button", name="Numbers").click()


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


def with_some_inputs(page: Any) -> None:
    page.locator(".analysis-change > summary").click()
    page.get_by_label("Measured from").select_option("nominal")
    page.get_by_label("Plane for the widths").select_option("symmetry")
    page.locator("h1").click()


def until_compared(page: Any) -> None:
    page.locator("[data-do='csv']").wait_for(timeout=LONG_MS)
    page.wait_for_timeout(SETTLED_MS)


def to_the_maps(page: Any) -> None:
    page.locator(".map-cell").first.wait_for(timeout=LONG_MS)


def of_the_liner(page: Any) -> None:
    page.locator("#test-liner").select_option(TESTED["labels"]["liner"])


def to_the_verdict_of_a_test(page: Any) -> None:
    page.locator("[data-result]").wait_for(timeout=LONG_MS)


def with_what_to_try(page: Any) -> None:
    page.locator(".alert").first.click()


SHOTS = {
    "operate": Shot("operate"),
    "operate-norsk": Shot("operate", language="nb-NO"),
    "live": Shot("live", with_numbers),
    "shape": Shot("shape"),
    "plots": Shot("plots", after_a_while),
    "captures": Shot("captures"),
    "capture": Shot("captures/{capture}", full=True),
    "replay": Shot("replay/{analysed}/30"),
    "analysis-request": Shot("analysis/{capture}", with_some_inputs, full=True),
    "analysis": Shot("analysis/{analysed}", to_the_maps, full=True),
    "compare": Shot("compare/{analysed},{other}", until_compared, full=True),
    "test": Shot("test/{tested}", to_the_verdict_of_a_test, full=True),
    "tests": Shot("tests", of_the_liner, full=True),
    "tests-ramp": Shot("tests/ramp", of_the_liner, full=True),
    "calibration": Shot("calibration", full=True),
    "calibration-place": Shot("calibration/place", full=True, stage=FRAME),
    "calibration-take": Shot("calibration/take", full=True, stage=FRAME),
    "calibration-found": Shot("calibration/found/{capture}", when_found, full=True, stage=FRAME),
    "calibration-adjust": Shot("calibration/adjust/{capture}", full=True, stage=FRAME),
    "calibration-review": Shot("calibration/adjust/{capture}", to_the_verdict, full=True, stage=FRAME),
    "sign-in": Shot("operate", stage="guarded"),
    "fault": Shot("operate", with_what_to_try, stage="unplugged"),
}


def take(folder: Path, names: list[str]) -> None:
    """Takes the pictures of these names, or all."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = {name: SHOTS[name] for name in names or SHOTS}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        for stage in dict.fromkeys(shot.stage for shot in wanted.values()):
            shots = {name: shot for name, shot in wanted.items() if shot.stage == stage}
            _take_of(browser, STAGES[stage], shots, folder)


def _take_of(browser: Any, stage: Stage, shots: dict[str, Shot], folder: Path) -> None:
    with tempfile.TemporaryDirectory() as state, Daemon(Path(state), **stage.options) as daemon:
        if stage.streams:
            daemon.wait_until_it_streams()
        captures = _captures(daemon, stage.order, " ".join(shot.hash for shot in shots.values()))
        if stage.guarded:
            daemon.add_token("tablet", "operator")
        for name, shot in shots.items():
            for look in LOOKS:
                address = f"{daemon.url}/#{shot.hash.format_map(captures)}"
                _take(browser, address, shot, look, folder / f"{name}-{look}.png")


def _captures(daemon: Daemon, order: dict[str, Any] | None, addresses: str) -> dict[str, str]:
    """Ids of those that the addresses name, by their names there."""
    named = [name for name in ("analysed", "other", "capture") if f"{{{name}}}" in addresses]
    captures = {name: daemon.capture(**(order or {})) for name in named}
    for name in captures.keys() & {"analysed", "other"}:
        daemon.analyse(captures[name], **INPUTS)
    if "{tested}" in addresses:
        daemon.ask("/profiles", body={"yaml": PROFILE.read_text(encoding="utf-8")})
        captures["tested"] = daemon.test(**TESTED)
    return captures


def _take(browser: Any, address: str, shot: Shot, look: str, file: Path) -> None:
    size, scheme = LOOKS[look]
    context = browser.new_context(
        viewport=size, color_scheme=scheme, locale=shot.language, timezone_id="Europe/Oslo"
    )
    page = context.new_page()
    page.goto(address)
    page.wait_for_selector("[data-panel], .sign-in")
    page.wait_for_timeout(SETTLED_MS)
    shot.prepare(page)
    if shot.full:  # as if the screen were so high: what is fixed to its end stays there
        page.set_viewport_size(size | {"height": page.evaluate("document.scrollingElement.scrollHeight")})
    page.wait_for_timeout(SETTLED_MS / 4)
    _write(page.screenshot(), file)
    context.close()


def _write(png: bytes, file: Path) -> None:
    """With a palette: a third of the size, and nobody sees it."""
    with Image.open(io.BytesIO(png)) as picture:
        few = picture.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    few.save(file, optimize=True)
    print(file, file.stat().st_size)


if __name__ == "__main__":
    take(Path(sys.argv[1]), sys.argv[2:])
