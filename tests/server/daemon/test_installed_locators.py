"""A locator of another package is chosen by its name, as those of the program are."""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from grabberd.archive.measure_setups import INSTALLED_LOCATORS, location_settings
from grabberd.core.field import Field, quantise
from grabberd.core.measurement import METHODS, measure
from grabberd.core.measurement.location import for_progressive
from grabberd.errors import InputError

LOCATOR = """
import numpy as np
from grabberd.core.measurement.locators import Located

def locate(seen):
    return Located(seen.centroids + (0.25, 0.0), np.full(seen.centroids.shape, 0.5))
"""


@pytest.fixture(autouse=True)
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A package with locators, as an installer would leave it."""
    info = tmp_path / "barn_locators-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: barn-locators\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(
        "[grabberd.locators]\nshifted = barn_locator:locate\nneedy = needy_locator:locate\n"
        "template = barn_locator:locate\n"
    )
    (tmp_path / "barn_locator.py").write_text(LOCATOR)
    (tmp_path / "needy_locator.py").write_text("import a_library_nobody_has\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    yield
    sys.modules.pop("barn_locator", None)


def discs() -> Field:
    luma = np.full((48, 80), 20, np.uint8)
    luma[8:12, 10:17] = 200
    return Field.intact(luma, 0)


@pytest.mark.parametrize("bits", [1, 8])
def test_it_locates_in_place_of_the_programs_own(bits: int) -> None:
    packed = quantise(discs(), bits, 100)
    own = location_settings({"method": "centroid", "line_jitter_px": 0.0})
    theirs = location_settings({"method": "shifted", "line_jitter_px": 0.0})
    before, after = measure(packed, None, own), measure(packed, None, theirs)
    assert (after.xy_px - before.xy_px).tolist() == [[0.25, 0.0]]
    assert after.sigma_px.tolist() == [[0.5, 0.5]]


def test_lines_of_progressive_pictures_do_not_shift_for_it_either() -> None:
    settings = for_progressive(location_settings({"method": "shifted"}))
    assert settings.line_jitter_px == 0.0
    assert settings.locator is INSTALLED_LOCATORS.load("shifted")


def test_it_is_not_imported_before_it_is_chosen() -> None:
    assert location_settings({}).locator is None
    assert "shifted" in INSTALLED_LOCATORS.available()
    assert "barn_locator" not in sys.modules


def test_the_programs_own_keep_their_names() -> None:
    assert location_settings({"method": "template"}).locator is None


def test_an_unknown_name_is_answered_with_all_that_there_are() -> None:
    with pytest.raises(InputError, match="unknown method 'shfted'; choose from automatic") as caught:
        location_settings({"method": "shfted"})
    assert all(name in caught.value.message for name in (*METHODS, "shifted", "needy"))
    assert "grabberd.locators" in caught.value.hint


def test_a_package_that_lacks_a_library_says_what_to_install() -> None:
    with pytest.raises(InputError, match="locator 'needy' cannot be imported") as caught:
        location_settings({"method": "needy"})
    assert "a_library_nobody_has" in caught.value.hint


def test_a_setting_cannot_bring_a_locator_itself() -> None:
    assert location_settings({"locator": "os:system"}).locator is None
