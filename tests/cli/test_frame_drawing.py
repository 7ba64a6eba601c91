"""The drawing by which a person says how a calibration frame stands."""

import numpy as np

from core.calibration.sights import FRAME
from grabberd.cli.calibrate import frame_drawing


def test_the_corners_have_their_ids_and_a_place_to_add_its_plus() -> None:
    lines = frame_drawing(FRAME, [(-30.9, -22.8, 0.0)])
    assert lines[0].split() == ["1", *"·······", "9"]
    assert lines[-1].split()[0] == "100"
    assert lines[-1].endswith("108")
    assert sum(line.count("+") for line in lines) == 1
    assert sum(line.count("·") for line in lines) == len(FRAME) - 4


def test_a_frame_that_is_too_wide_for_a_terminal_is_not_drawn() -> None:
    wide = FRAME.select(np.flatnonzero(FRAME.row == 0))
    assert frame_drawing(wide)
    assert frame_drawing(FRAME, ())[0].count("·") == 7
