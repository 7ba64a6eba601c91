"""No wrong set-up of a calibration is accepted without a word, and the word is the right one.

Every second cell of the table is tried here; `make setups` tries all.
"""

from dataclasses import replace

import pytest

from grabberd.config import shipped_configs
from proofs.setups.cases import JOINED, ORIENTATION, SETUPS, UNREMARKED, WRONG_SIGN, Setup, tried

PAGE = shipped_configs().parent / "docs" / "reference" / "wrong-setups.md"
OF_IRREGULAR = [one for one in SETUPS if "irregular" in one.frames][::2]
OF_ALIKE = [(one, frame) for one in ORIENTATION for frame in ("marked", "regular") if frame in one.frames][
    ::2
]


@pytest.mark.parametrize("setup", OF_IRREGULAR, ids=[one.wrong for one in OF_IRREGULAR])
def test_what_is_wrong_is_told(setup: Setup) -> None:
    told = tried(setup)
    assert told.verdict != UNREMARKED
    assert told.says(setup.told), told


@pytest.mark.parametrize(
    ("setup", "frame"), OF_ALIKE, ids=[f"{one.wrong}, {frame}" for one, frame in OF_ALIKE]
)
def test_how_a_frame_stands_that_looks_the_same_in_several_ways_is_never_guessed(
    setup: Setup, frame: str
) -> None:
    told = tried(setup, frame)
    assert told.verdict != UNREMARKED
    assert told.says(setup.told_of(frame)), told


@pytest.mark.parametrize("frame", ["irregular", "marked", "regular"])
def test_a_right_set_up_passes_without_a_remark(frame: str) -> None:
    told = tried(Setup("nothing", ""), frame)
    assert told.codes == (("stated",) if frame == "regular" else ())


@pytest.mark.parametrize("frame", ["irregular", "regular"])
def test_a_place_of_the_file_on_another_target_is_no_overlap_of_discs(frame: str) -> None:
    told = tried(WRONG_SIGN, frame)
    assert told.codes[0] == "elsewhere"
    assert "merging" not in told.codes
    assert told.says("places them: 39 by 2")
    assert not told.says("; 43 by")


def test_discs_that_the_file_alone_lets_run_into_each_other_are_not_blamed() -> None:
    """The file of a frame with steep steps, before a camera that sees one without."""
    told = tried(replace(JOINED, shown=Setup("", "").shown))
    assert told.verdict == "refused"
    assert not told.says(JOINED.told)


def test_the_page_has_every_set_up_and_no_silent_one() -> None:
    lines = PAGE.read_text("utf-8").splitlines()
    rows = [line.split(" | ")[0].removeprefix("| ") for line in lines if line.startswith("| ")]
    assert rows[2:] == [one.wrong for one in SETUPS]
    assert not any("**silent**" in line for line in lines)
