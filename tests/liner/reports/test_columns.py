import numpy as np

from grabberd_liner.reports.columns import Columns
from liner.reports.analysis_documents import table

KNOWN = Columns(
    table("a table", n=("", [1, 2]), width_mm=("mm", [9.123, None], [0.02, None]), share=("1", [0.5, 1]))
)


def test_what_is_not_known_is_nan_and_written_as_a_dash():
    assert np.isnan(KNOWN.numbers("width_mm")[1])
    assert KNOWN.cell("width_mm", 1) == "–"


def test_a_measured_value_is_written_to_the_place_of_its_sigma():
    assert KNOWN.cell("width_mm", 0) == "9.123 (0.020)"
    assert KNOWN.cells("width_mm") == ["9.123 (0.020)", "–"]
    assert KNOWN.estimate("width_mm") == "9.123 ± 0.020 mm"


def test_the_unit_one_is_not_written():
    assert KNOWN.estimate("share", 1) == "0.5"
    assert KNOWN.titled("share", "share") == "share"
    assert KNOWN.titled("width_mm", "width") == "width [mm]"


def test_a_column_that_there_is_not_is_unknown_throughout():
    assert not KNOWN.is_known("height_mm")
    assert len(KNOWN.numbers("height_mm")) == len(KNOWN) == 2


def test_a_spread_leaves_out_what_is_not_known():
    assert KNOWN.spread("width_mm") == (9.123, 9.123, 9.123, 0.02)
    assert KNOWN.spread("share") == (0.5, 0.75, 1.0, None)
