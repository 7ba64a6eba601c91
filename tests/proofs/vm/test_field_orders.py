"""Every field order and format of the kernel's test device, through our driver, at full rate."""

import pytest

from proofs.vm.guest import field_order, streams, vivid
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

SECONDS = 15.0
FORMATS = ("GREY", "YUYV", "UYVY", "NV12")
ONE_PARITY = {"top": 0, "bottom": 1}
OLDER = {
    "alternate": 0,
    "interlaced": 0,
    "interlaced_tb": 0,
    "interlaced_bt": 1,
    "seq_tb": 0,
    "seq_bt": 1,
}
MOVES_PX = 2
"""By how much the pattern moves from one field to the next."""
LIES = ("seq_bt",)
"""The test device draws the top field of these as the older, whatever it says."""

NOTE = (
    f"Lost: fields lost in {SECONDS:g} s, according to the ledger. Rows and parity: alternating lines and "
    "squares of the device's own patterns are where they should be. Age: a moving pattern advances by the "
    "same step from each field to the next; in seq_bt the device draws the top field as the older one, "
    "contrary to what it reports, and `older_field: top` corrects that."
)


@pytest.fixture
def patterns(timed: Machine) -> Machine:
    """The device draws its own patterns."""
    timed.call(vivid.load_patterns)
    return timed


@pytest.mark.parametrize("pixel_format", FORMATS)
@pytest.mark.parametrize("order", [*OLDER, *ONE_PARITY])
def test_every_field_comes_at_its_rate_with_its_rows_and_parity(
    timed: Machine, tables: Tables, order: str, pixel_format: str
) -> None:
    if not timed.call(vivid.draws_patterns):
        timed.call(vivid.load_patterns)
    rate = timed.call(streams.rate, seconds=SECONDS, field_order=order, format=pixel_format)
    older = {"older_field": "top"} if order in LIES else {}
    pictures = timed.call(streams.pictures_in_order, field_order=order, format=pixel_format, **older)
    nominal_hz = 25.0 if order in ONE_PARITY else 50.0
    step = MOVES_PX * 50.0 / nominal_hz
    tables.add(
        "Field order × format",
        NOTE,
        field_order=order,
        format=pixel_format,
        granted=rate["granted"],
        rate_Hz=f"{rate['rate_hz']:.2f}",
        fields=rate["fields"],
        lost=rate["lost"],
        rows=_word(pictures["rows"]),
        parity=_word(pictures["parity"]),
        age=_word(pictures["steps"] == [step]),
    )
    assert rate["nominal_hz"] == nominal_hz
    assert rate["rate_hz"] == pytest.approx(nominal_hz, rel=1e-3)
    assert rate["fields"] >= nominal_hz * SECONDS - 2
    assert (rate["lost"], rate["ledger"]) == (0, "complete")
    assert pictures["rows"]
    assert pictures["parity"]
    assert pictures["steps"] == [step]
    assert set(pictures["parities"]) == ({ONE_PARITY[order]} if order in ONE_PARITY else {0, 1})


@pytest.mark.parametrize(("order", "older"), OLDER.items())
def test_the_older_field_of_a_frame_is_delivered_first(patterns: Machine, order: str, older: int) -> None:
    parities = patterns.call(streams.pictures_in_order, field_order=order)["parities"]
    assert parities == [older, 1 - older] * (len(parities) // 2)


@pytest.mark.parametrize("order", ONE_PARITY)
def test_one_parity_alone_is_said_to_be_half_the_rate(patterns: Machine, order: str) -> None:
    remarks = patterns.call(streams.rate, seconds=1.0, field_order=order)["remarks"]
    assert any("25 fields a second instead of 50" in remark for remark in remarks)


def test_movement_finds_out_a_device_that_lies_about_its_field_order(patterns: Machine) -> None:
    forth_and_back = [3 * MOVES_PX, streams.CHECKER_COLUMNS - MOVES_PX]
    assert patterns.call(streams.pictures_in_order, field_order="seq_bt")["steps"] == forth_and_back


@pytest.mark.parametrize(
    ("order", "options", "found"),
    [
        ("interlaced", {}, "right"),
        ("interlaced", {"older_field": "bottom"}, "reversed"),
        ("seq_bt", {}, "reversed"),
    ],
)
def test_the_check_of_the_field_order_judges_by_movement(
    fast: Machine, order: str, options: dict[str, str], found: str
) -> None:
    if not fast.call(vivid.draws_patterns):
        fast.call(vivid.load_patterns)
    assert fast.call(field_order.checked, field_order=order, **options)["order"] == found


def _word(right: bool) -> str:
    return "right" if right else "WRONG"
