"""What a driver has not written of a buffer is told by row, and so is a frame that may be of two."""

import numpy as np
import pytest

from drivers.v4l2.bench import dongle, pci_card
from drivers.v4l2.fake_kernel import field_picture
from drivers.v4l2.taking import first_picture, take
from grabberd.core.ledger import OF_FRAME_BEFORE, LossCause, Outcome, cause_of_loss

LINE = 1440
CHUNK = LINE // 3 * 2
"""What usbtv sends at once: two thirds of a line."""
FLAGGED = "the driver flags an error"


def easycap(**traits):
    return dongle(driver="usbtv", **traits)


def row(line, first=0, end=LINE):
    """Bytes of a line of the frame."""
    return slice(line * LINE + first, line * LINE + end)


def damages(bench, count=16):
    return [grabbed.damage for grabbed in take(bench, count)]


@pytest.mark.parametrize("gap", [row(100, 0, CHUNK), row(100, LINE - CHUNK), row(100, 240, 240 + CHUNK)])
@pytest.mark.parametrize("unit", [3, 40])
def test_a_single_chunk_is_missed_in_the_first_round_of_buffers_and_later(streaming, gap, unit):
    found = damages(streaming(easycap(unwritten={unit: [gap]})), 2 * unit + 8)
    assert found.pop(2 * unit + 1) == "stale from line 100 to line 100"
    assert not any(found)


def test_only_the_field_with_the_gap_is_damaged(streaming):
    gaps = [row(line) for line in range(301, 576, 2)]
    found = damages(streaming(easycap(unwritten={5: gaps})))
    assert found[10:12] == ["stale from line 301", None], "of usbtv, the bottom field is the older one"
    assert not any(found[:10] + found[12:])


def test_a_flag_that_tells_of_gaps_damages_the_field_that_has_them(streaming):
    found = damages(streaming(easycap(unwritten={5: [row(100)]}, flagged={5, 6})))
    assert found[10:12] == [None, FLAGGED]
    assert found[12:14] == [FLAGGED, FLAGGED], "without a gap, it may be either"


def test_a_flag_that_may_mean_more_damages_both(streaming):
    found = damages(streaming(dongle(driver="em28xx", unwritten={5: [row(100)]}, flagged={5})))
    assert found[10:12] == [FLAGGED, FLAGGED]


def test_a_short_frame_damages_the_field_that_is_short(streaming):
    gaps = [row(571), row(573), row(575)]
    found = damages(streaming(dongle(driver="stk1160", unwritten={5: gaps}, short={5: 829440 - 3 * LINE})))
    assert found[10:12] == [None, f"short: {829440 - 3 * LINE} of 829440 bytes"]


def test_what_a_driver_never_writes_is_no_gap(streaming):
    half = {unit: [row(0, 0, CHUNK), row(575, CHUNK)] for unit in range(30)}
    found = damages(streaming(dongle(unwritten=half)), 60)
    assert found[:2] == ["stale from line 0 to line 0", "stale from line 575"], "the first frame may be cut"
    assert not any(found[2:])


@pytest.mark.parametrize("fourcc", ["GREY", "YUYV", "UYVY", "NV12"])
def test_marks_are_in_no_picture(streaming, fourcc):
    fields = take(streaming(pci_card("tw68", formats=(fourcc,)), field_order="interlaced"), 40)
    for number, grabbed in enumerate(fields, first_picture(fields)):
        assert grabbed.damage is None
        assert np.array_equal(grabbed.field.luma, field_picture(number))


@pytest.mark.parametrize(
    ("driver", "old"),
    [("usbtv", [OF_FRAME_BEFORE, None]), ("stk1160", [OF_FRAME_BEFORE] * 2), ("em28xx", [None, None])],
)
def test_after_a_gap_a_frame_may_be_of_the_one_before(streaming, driver, old):
    found = damages(streaming(dongle(driver=driver, lost={5, 9, 10})), 24)
    assert found[10:12] == old
    assert found[16:18] == old
    assert not any(found[:10] + found[12:16] + found[18:])
    assert cause_of_loss(Outcome.DAMAGED, OF_FRAME_BEFORE) is LossCause.CABLE
