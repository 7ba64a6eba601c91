"""Progressive pictures of a webcam, and fields of 525 lines, from the kernel's test device at full rate."""

from collections.abc import Iterator

import pytest

from proofs.vm.guest import faults, instrument, refusals, streams, vivid
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

SECONDS = 10.0
NTSC_HZ = 60_000 / 1001
WEBCAM = 0
RIG = {
    "columns": 640,
    "lines": 360,
    "views": {
        "left": {"first_column": 0, "end_column": 320},
        "right": {"first_column": 320, "end_column": 640},
    },
}
OF_SERVICE = {"rig": RIG, "input": WEBCAM, "size": "640x360", "rate_hz": 40.0, "format": "GREY"}
PROGRESSIVE = 2
FEW = 3
"""Fields of ten seconds that the kernel's test device may be late with.

It is late where a period is no multiple of its tick, or the host is busy. The ledger then tells fields as
lost, and more of them as having an uncertain number, until their times agree again.
"""
NOTE = (
    "Lost: fields lost in 10 s, according to the ledger. A progressive webcam, and a camera of 525 lines: "
    "its pattern advances by the same step from each field to the next, its squares are where they should be."
)


@pytest.fixture
def webcam(timed: Machine) -> Machine:
    """A device with a webcam among its inputs."""
    if not timed.call(streams.offered)["pictures"]:
        timed.call(vivid.load_camera)
    return timed


@pytest.fixture
def patterns(timed: Machine) -> Machine:
    """A device with standards alone."""
    timed.call(vivid.load_patterns)
    return timed


def test_a_webcams_sizes_and_rates_are_listed(timed: Machine) -> None:
    timed.call(vivid.load_camera)
    told = timed.call(streams.offered)
    assert "GREY 320×180 at 60" in told["pictures"]
    assert "YUYV 1280×720 at" in told["pictures"]


@pytest.mark.parametrize(
    ("size", "rate_hz", "pixel_format"),
    [
        ("320x180", 60.0, "GREY"),
        ("320x180", 30.0, "NV12"),
        ("640x360", 40.0, "YUYV"),
        ("640x360", 25.0, "UYVY"),
        ("1280x720", 12.5, "GREY"),
    ],
)
def test_progressive_pictures_come_at_the_rate_that_was_granted(
    webcam: Machine, tables: Tables, size: str, rate_hz: float, pixel_format: str
) -> None:
    asked = {"input": WEBCAM, "size": size, "rate_hz": rate_hz, "format": pixel_format}
    rate = webcam.call(streams.rate, seconds=SECONDS, left_out=4, **asked)
    seen = webcam.call(streams.whole_pictures, **asked)
    tables.add(
        "Progressive pictures and 525 lines",
        NOTE,
        asked=f"{size} at {rate_hz:g} in {pixel_format}",
        granted=rate["granted"],
        rate_Hz=f"{rate['rate_hz']:.2f}",
        fields=rate["fields"],
        lost=rate["lost"],
        steps=seen["steps"],
    )
    assert rate["granted"].startswith("progressive")
    assert rate["nominal_hz"] == rate_hz
    # A picture that the device leaves out is missing among the stamps, and in the ledger.
    exposed = rate["fields"] + rate["lost"]
    assert rate["rate_hz"] * (exposed - 1) / (rate["fields"] - 1) == pytest.approx(rate_hz, rel=1e-3)
    assert exposed >= rate_hz * SECONDS - 3
    assert rate["lost"] <= FEW
    assert (rate["ledger"] == "complete") == (rate["lost"] == 0)
    assert seen["parities"] == [PROGRESSIVE]
    assert seen["lines"] == int(size.partition("x")[2])
    assert len(seen["steps"]) == 1


def test_squares_of_whole_pictures_lie_where_they_should(webcam: Machine) -> None:
    seen = webcam.call(streams.whole_pictures, input=WEBCAM, size="640x360", rate_hz=25.0, format="GREY")
    assert seen["bands"] == [0]
    assert seen["count"] == [(360 - 1) // 16]


@pytest.mark.parametrize("asked", [{"size": "800x600"}, {"size": "640x360", "rate_hz": 60.0}])
def test_what_a_webcam_does_not_offer_is_refused_with_what_it_does(
    webcam: Machine, asked: dict[str, object]
) -> None:
    refusal = webcam.call(refusals.of, input=WEBCAM, **asked)
    assert refusal["kind"] == "DeviceRefused"
    assert "640×360 at 40" in refusal["message"]


def test_a_webcam_without_options_gives_what_is_large_and_quick_enough(webcam: Machine) -> None:
    assert "25 Hz" in webcam.call(streams.rate, seconds=1.0, input=WEBCAM)["granted"]


@pytest.mark.parametrize("order", ["alternate", "interlaced", "seq_tb"])
def test_fields_of_525_lines_come_at_their_rate_the_older_first(
    patterns: Machine, tables: Tables, order: str
) -> None:
    rate = patterns.call(streams.rate, seconds=SECONDS, left_out=4, standard="NTSC", field_order=order)
    seen = patterns.call(streams.pictures_in_order, field_rows=240, standard="NTSC", field_order=order)
    tables.add(
        "Progressive pictures and 525 lines",
        NOTE,
        asked=f"NTSC, {order}",
        granted=rate["granted"],
        rate_Hz=f"{rate['rate_hz']:.2f}",
        fields=rate["fields"],
        lost=rate["lost"],
        steps=seen["steps"],
    )
    assert rate["standard"] == "NTSC"
    assert rate["rate_hz"] == pytest.approx(NTSC_HZ, abs=(FEW + 1) / SECONDS)
    assert rate["fields"] >= NTSC_HZ * SECONDS - FEW - 3
    assert (rate["ledger"] == "complete") == (rate["lost"] == 0)
    assert seen["rows"]
    assert seen["parity"]
    assert order == "seq_tb" or len(seen["steps"]) == 1


def test_a_woven_frame_of_525_lines_has_its_bottom_field_first(patterns: Machine) -> None:
    seen = patterns.call(streams.pictures_in_order, field_rows=240, standard="NTSC", field_order="interlaced")
    assert seen["parities"] == [1, 0] * (len(seen["parities"]) // 2)


def test_a_camera_of_60_hz_where_50_are_configured_is_told_with_its_remedy(patterns: Machine) -> None:
    # Controls are of the input that was selected last.
    assert patterns.call(refusals.of, input=vivid.S_VIDEO) is None
    patterns.call(vivid.set_controls, standard_signal_mode=4)
    refusal = patterns.call(refusals.of, input=vivid.S_VIDEO)
    at_60_hz = patterns.call(refusals.of, input=vivid.S_VIDEO, standard="NTSC")
    patterns.call(vivid.set_controls, standard_signal_mode=0)
    assert "60 Hz (NTSC), but the card is set to 50 Hz (PAL)" in refusal["message"]
    assert "standard: NTSC" in refusal["hint"]
    assert at_60_hz is None


@pytest.fixture
def served(fast: Machine) -> Iterator[Machine]:
    """A webcam for the whole service."""
    fast.call(vivid.load_camera)
    fast.call(vivid.show_picture)
    yield fast
    fast.call(instrument.stop)


def test_a_capture_of_a_webcam_through_the_service_is_complete(served: Machine) -> None:
    results = [served.call(faults.quiet, seconds=10.0, **OF_SERVICE)]
    if results[-1]["ledger"] != "complete":  # a busy host's disk, see the other captures
        results.append(served.call(faults.quiet, seconds=10.0, **OF_SERVICE))
    assert results[-1]["ledger"] == "complete", results
    assert results[-1]["received"] > 400


@pytest.mark.parametrize(
    ("fault", "reason"), [("one buffer in five dropped", "gap"), ("unplugged for 5 s", "unplugged")]
)
def test_pictures_of_a_webcam_that_do_not_come_are_in_the_ledger(
    served: Machine, fault: str, reason: str
) -> None:
    result = served.call(faults.suffer, name=fault, **OF_SERVICE)
    assert result["recovered_s"] is not None
    assert any(reason in entry[2] for entry in result["entries"]), result["ledger"]
    assert result["received"] + sum(count for count, *_ in result["entries"]) == result["total"]
