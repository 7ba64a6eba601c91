"""A calibration frame that looks the same in several ways: the page asks, and one tap answers."""

from collections.abc import Iterator

import pytest
import yaml
from playwright.sync_api import Locator, Page, expect

from browser.axe import serious
from browser.conftest import PHONE, Open
from browser.daemons import Daemon
from grabberd.config import shipped_configs

LONG_MS = 600_000
NAME = "of-the-barn"


@pytest.fixture(scope="module")
def before_a_regular_frame(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    """A daemon without a calibration whose camera sees a regular frame."""
    folder = tmp_path_factory.mktemp("regular")
    frame = yaml.safe_load((shipped_configs() / "calibration-frames" / "paper-108.yaml").read_text())
    for target in frame["targets"]:
        # Depths that a turn by 180 degrees and both mirror images leave as they are.
        inward = min(target["row"], 11 - target["row"]) + abs(target["column"] - 4)
        target["z_mm"] = 4.0 * (inward % 3) - 4.0
    (folder / "calibration-frames").mkdir()
    (folder / "calibration-frames" / f"{NAME}.yaml").write_text(yaml.safe_dump(frame))
    config = yaml.safe_load((shipped_configs() / "fake-calibration-frame.yaml").read_text())
    facing = {"nx": 0.0, "ny": 0.0, "nz": 1.0}
    points = [{key: one[key] for key in ("id", "x_mm", "y_mm", "z_mm")} | facing for one in frame["targets"]]
    (device,) = config["devices"].values()
    device["options"] = {"scene": "points", "points": points}
    (folder / "config.yaml").write_text(yaml.safe_dump(config))
    with Daemon(folder, config=str(folder / "config.yaml"), location="weighted") as daemon:
        yield daemon


def captured(daemon: Daemon) -> str:
    """Address of the page that shows the targets in a new capture."""
    capture = daemon.capture(fields=50, bits=8, labels={"calibration_frame": NAME})
    return f"{daemon.url}/#calibration/found/{capture}"


def asked(page: Page) -> Locator:
    """The rings of the possible places of the target asked for, by the corner that they are at."""
    expect(page.get_by_text("Where is target 1? Tap its yellow ring.")).to_be_visible(timeout=LONG_MS)
    rings = page.get_by_role("button", name="Target 1 is here")
    expect(rings).to_have_count(4)
    return rings


def at(rings: Locator, across: int, down: int) -> Locator:
    """The one of four that is leftmost (0) or rightmost (1), of the topmost (0) or lowest (1)."""
    boxes = [rings.nth(n).bounding_box() for n in range(4)]
    places = [(one["x"], one["y"], n) for n, one in enumerate(boxes) if one]
    rows = sorted(places, key=lambda place: place[1])
    return rings.nth(sorted(rows[2 * down : 2 * down + 2])[across][2])


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_one_tap_says_how_the_frame_stands_and_it_is_calibrated(
    before_a_regular_frame: Daemon, open_page: Open
) -> None:
    daemon = before_a_regular_frame
    page = open_page(captured(daemon)).page
    rings = asked(page)
    expect(page.get_by_text("X -53.6 mm, Y -26.0 mm")).to_be_visible()
    expect(page.get_by_role("link", name="Next")).to_have_count(0)
    assert serious(page) == []

    at(rings, 1, 0).click()
    expect(page.get_by_text("The picture is mirrored, or its halves are swapped.")).to_be_visible(
        timeout=LONG_MS
    )
    page.get_by_role("button", name="Ask again").click()
    at(asked(page), 0, 0).click()
    expect(page.get_by_text("All 108 targets were found in both views.")).to_be_visible(timeout=LONG_MS)
    expect(page.get_by_text("The calibration frame stands turned by 0° in the picture.")).to_be_visible()

    page.get_by_role("link", name="Next").click()
    page.get_by_role("button", name="Compute").click()
    expect(page.locator("[data-verdict]")).to_have_attribute(
        "data-verdict", "passed_with_remarks", timeout=LONG_MS
    )
    expect(page.locator("[data-reason=stated]")).to_contain_text("rests on what you said")
    made = daemon.ask("/calibrations?limit=1")["calibrations"][0]["id"]
    assert daemon.ask(f"/calibrations/{made}")["details"]["calibration_frame"]["turn_deg"] == pytest.approx(
        0.0, abs=5.0
    )


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_rings_are_large_enough_for_gloves_on_a_phone(
    before_a_regular_frame: Daemon, open_page: Open
) -> None:
    page = open_page(captured(before_a_regular_frame), size=PHONE, language="nb").page
    rings = page.locator("[data-do=name-target]")
    expect(page.get_by_text("Hvor er målemerke 1?")).to_be_visible(timeout=LONG_MS)
    expect(rings).to_have_count(4)
    assert all(box["width"] >= 44 for n in range(4) if (box := rings.nth(n).bounding_box()))
    assert page.evaluate("document.scrollingElement.scrollWidth <= innerWidth")
    assert "{" not in page.locator("main").inner_text()
    assert serious(page) == []
