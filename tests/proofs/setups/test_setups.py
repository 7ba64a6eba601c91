"""No wrong set-up of a calibration is accepted without a word, and the word is the right one."""

import pytest

from grabberd.config import shipped_configs
from proofs.setups.cases import SETUPS, UNREMARKED, Setup, tried

PAGE = shipped_configs().parent / "docs" / "reference" / "wrong-setups.md"


@pytest.mark.parametrize("setup", SETUPS, ids=[one.wrong for one in SETUPS])
def test_what_is_wrong_is_told(setup: Setup) -> None:
    told = tried(setup)
    assert told.verdict != UNREMARKED
    assert told.says(setup.told), told


def test_a_right_set_up_passes_without_a_remark() -> None:
    told = tried(Setup("nothing", ""))
    assert (told.verdict, told.lines) == (UNREMARKED, ())


def test_the_page_has_every_set_up() -> None:
    rows = [
        line.split(" | ")[0].removeprefix("| ")
        for line in PAGE.read_text("utf-8").splitlines()
        if line.startswith("| ")
    ]
    assert rows[1:] == [one.wrong for one in SETUPS]
