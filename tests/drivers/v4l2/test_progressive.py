"""A digital camera is asked for size, rate and format; what it grants is believed, what it does not is
told.
"""

import contextlib
import errno
from fractions import Fraction

import pytest

from drivers.v4l2.bench import Bench, camera, card_with, dongle
from grabberd.core.field import PROGRESSIVE, FieldOrder
from grabberd.errors import DeviceError, DeviceRefused
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement

MACHINE_VISION = {"GREY": {(640, 480): (5, 200), (1456, 1088): (5, 200)}}


@pytest.fixture
def bench(tmp_path):
    def make(made=None, **options):
        return Bench(tmp_path, camera() if made is None else made, **options)

    return make


def granted(bench):
    info = bench.grabber.open()
    return info.pixel_format, (info.columns, info.field_rows), round(info.rate_hz, 2)


def refusal(bench):
    with pytest.raises(DeviceRefused) as caught:
        bench.grabber.open()
    assert caught.value.hint
    assert bench.nothing_is_left_behind()
    return caught.value


# --- what is chosen ---


@pytest.mark.parametrize(
    ("options", "chosen"),
    [
        ({}, ("YUYV", (640, 480), 30.0)),
        ({"size": "1280x720"}, ("MJPG", (1280, 720), 60.0)),
        ({"size": "1280x720", "rate_hz": 30}, ("MJPG", (1280, 720), 30.0)),
        ({"size": "1280x720", "format": "YUYV"}, ("YUYV", (1280, 720), 10.0)),
        ({"size": "640x480", "rate_hz": 60}, ("MJPG", (640, 480), 60.0)),
        ({"size": "640×480", "rate_hz": 15}, ("YUYV", (640, 480), 15.0)),
        ({"rate_hz": 120}, ("YUYV", (320, 240), 120.0)),
        ({"format": ["MJPG", "YUYV"]}, ("MJPG", (1920, 1080), 30.0)),
        ({"format": "MJPG", "rate_hz": 60}, ("MJPG", (1280, 720), 60.0)),
    ],
)
def test_uncompressed_pictures_that_come_often_enough_are_preferred_and_options_are_kept_to(
    bench, options, chosen
):
    assert granted(bench(**options)) == chosen


def test_what_was_granted_is_in_the_streams_description(bench):
    made = bench(size="1280x720", rate_hz=30)
    info = made.grabber.open()
    assert info.field_order is FieldOrder.PROGRESSIVE
    assert (info.standard, info.buffers, info.counts_losses, info.live) == ("", 16, True, True)
    assert info.details["field order of the driver"] == "NONE"
    assert any("JPEG" in remark for remark in info.remarks)


def test_the_rate_is_set_after_the_format_and_before_the_buffers(bench):
    made = bench()
    made.grabber.open()
    setting = [name for name in made.kernel.calls if name.startswith(("S_", "REQBUFS", "STREAMON"))]
    assert setting == ["S_INPUT", "S_FMT", "S_PARM", "REQBUFS", "STREAMON"]
    assert made.kernel.calls[made.kernel.calls.index("S_PARM") + 1] == "G_PARM"


@pytest.mark.parametrize("hz", [Fraction(30_000, 1001), Fraction(30)])
def test_a_rate_is_asked_for_as_people_write_it(bench, hz):
    made = bench(camera(modes={"YUYV": {(640, 480): (hz,)}}), rate_hz=30)
    assert made.grabber.open().rate_hz == pytest.approx(float(hz), rel=1e-9)


@pytest.mark.parametrize(
    ("options", "chosen"),
    [
        ({}, ("GREY", (1456, 1088), 200.0)),
        ({"size": "1280x720", "rate_hz": 100}, ("GREY", (1280, 720), 100.0)),
        ({"size": "800x600", "rate_hz": 59.94}, ("GREY", (800, 600), 59.94)),
    ],
)
def test_of_a_range_what_is_asked_for_is_taken(bench, options, chosen):
    assert granted(bench(camera(modes=MACHINE_VISION, span=True), **options)) == chosen


def test_a_driver_that_lists_nothing_is_asked_all_the_same(bench):
    made = bench(camera(tells_modes=False), size="640x480", rate_hz=15, format="YUYV")
    assert granted(made) == ("YUYV", (640, 480), 15.0)


def test_a_camera_that_offers_what_it_does_not_grant_is_asked_for_the_next_best(bench):
    made = bench(camera(modes={"YUYV": {(640, 480): (30,)}, "MJPG": {(640, 480): (60,)}}))
    made.card.answers["S_FMT"].append(errno.EINVAL)
    assert granted(made) == ("MJPG", (640, 480), 60.0)


def test_whole_pictures_can_be_asked_for_by_the_order_none(bench):
    assert bench(field_order="none").grabber.open().field_order is FieldOrder.PROGRESSIVE


@pytest.mark.parametrize(("columns", "lines"), [(720, 576), (720, 480)])
def test_sizes_of_analog_video_are_remarked_on(bench, columns, lines):
    made = bench(camera(modes={"YUYV": {(columns, lines): (25,)}}))
    assert any("one field of every frame away" in remark for remark in made.grabber.open().remarks)


def test_too_few_buffers_for_the_rate_are_remarked_on(bench, tmp_path):
    fast = {"GREY": {(640, 480): (200,)}}
    assert any("last for 80 ms" in remark for remark in bench(camera(modes=fast)).grabber.open().remarks)
    enough = Bench(tmp_path / "enough", camera(modes=fast), buffers=32).grabber.open()
    assert not any("last for" in remark for remark in enough.remarks)


def test_a_camera_whose_driver_knows_no_inputs_is_opened(bench):
    assert granted(bench(camera(sockets=()))) == ("YUYV", (640, 480), 30.0)


# --- what is refused ---


@pytest.mark.parametrize(
    "options",
    [
        {"size": "800x600"},
        {"rate_hz": 50},
        {"size": "1280x720", "rate_hz": 120},
        {"size": "1920x1080", "format": "YUYV"},
    ],
)
def test_what_the_camera_does_not_offer_is_refused_with_all_that_it_does(bench, options):
    told = refusal(bench(**options))
    assert "YUYV 1280×720 at 10, 5" in told.message
    assert ("MJPG 1280×720 at 60, 30" in told.message) == ("format" not in options)
    assert "'size', 'rate_hz'" in told.hint


def test_a_rate_that_is_not_kept_to_is_refused_with_the_one_granted(bench):
    told = refusal(bench(camera(keeps_rate=25), size="640x480", rate_hz=30))
    assert "it grants YUYV 640×480 at 25 a second" in told.message


def test_a_size_that_is_not_kept_to_is_refused_with_the_one_granted(bench):
    told = refusal(bench(camera(tampers=lambda pix: setattr(pix, "height", 360)), size="640x480"))
    assert "YUYV 640×360" in told.message


def test_fields_in_place_of_whole_pictures_are_refused(bench):
    made = bench(camera(tampers=lambda pix: setattr(pix, "field", Arrangement.INTERLACED)))
    assert "in field order INTERLACED" in refusal(made).message


def test_a_camera_that_does_not_tell_its_rate_is_refused(bench):
    assert "an unknown rate" in refusal(bench(camera(tells_rate=False))).message


def test_a_camera_that_is_too_slow_for_anything_that_moves_is_refused(bench):
    told = refusal(bench(camera(modes={"YUYV": {(2048, 1536): (3,)}})))
    assert "YUYV 2048×1536 at 3" in told.message
    assert "5 or more" in told.hint


def test_a_camera_without_a_format_that_can_be_read_is_refused(bench):
    told = refusal(bench(camera(modes={"H264": {(1280, 720): (30,)}})))
    assert "delivers H264" in told.message
    assert "MJPG" in told.hint


def test_a_camera_has_no_standard_to_be_set_to(bench):
    told = refusal(bench(standard="PAL"))
    assert "none at all" in told.message
    assert "needs neither 'standard'" in told.hint


def test_a_card_with_standards_that_grants_no_whole_pictures_says_what_it_grants(bench):
    told = refusal(bench(card_with(), field_order="none"))
    assert "requested progressive pictures" in told.message


def test_a_stick_that_throws_fields_away_is_refused_though_it_looks_like_a_camera(bench):
    assert "throws one field" in refusal(bench(usb_id="534d:0021")).message


def test_an_input_cannot_be_named_where_there_are_none(bench):
    assert "no inputs" in refusal(bench(camera(sockets=()), input=0)).message


@pytest.mark.parametrize("answer", [errno.EIO, errno.EINVAL, errno.ENODEV, errno.EBUSY])
@pytest.mark.parametrize("fourcc", ["YUYV", "MJPG"])
def test_whichever_call_is_refused_nothing_is_left_behind_and_the_next_time_it_opens(
    tmp_path, fourcc, answer
):
    def made(folder):
        return Bench(folder, camera(modes={fourcc: {(640, 480): (30,)}}), buffers=8)

    whole = made(tmp_path / "whole")
    whole.grabber.open()
    for number in range(1, len(whole.kernel.calls) + 1):
        one = made(tmp_path / str(number))
        one.kernel.refuse_call, one.kernel.refuse_with = number, answer
        with contextlib.suppress(DeviceError):
            one.grabber.open()
            one.grabber.close()
        assert one.nothing_is_left_behind(), whole.kernel.calls[number - 1]
        one.grabber.open()
        with one.grabber.dequeue(1.0) as fields:
            assert fields


@pytest.mark.parametrize("call", ["ENUM_FRAMESIZES", "S_PARM", "G_PARM"])
def test_a_camera_that_hangs_is_no_camera_that_cannot(bench, call):
    made = bench()
    made.card.answers[call].append(errno.EIO)
    with pytest.raises(Exception, match="does not respond"):
        made.grabber.open()


# --- fields of a standard keep to the same options ---


def test_a_dongles_columns_can_be_chosen(bench):
    assert bench(dongle(), size="640x576").grabber.open().columns == 640


@pytest.mark.parametrize(
    ("options", "said", "advice"),
    [
        ({"size": "720x480"}, "a frame of PAL has 576 lines, not 480", "'standard: NTSC' has 480"),
        ({"rate_hz": 60}, "PAL has 50 fields a second, not 60", "59.94"),
        ({"standard": "NTSC", "size": "720x576"}, "a frame of NTSC has 480", "'standard: PAL' has 576"),
    ],
)
def test_a_size_or_rate_of_the_other_standard_names_it(bench, options, said, advice):
    told = refusal(bench(dongle(camera=0x1000), **options))
    assert said in told.message
    assert advice in told.hint


def test_a_rate_that_is_the_standards_own_is_no_harm(bench):
    assert bench(dongle(), rate_hz=50).grabber.open().rate_hz == 50.0


# --- what comes ---


@pytest.mark.parametrize("fourcc", ["GREY", "NV12", "YUYV", "UYVY"])
@pytest.mark.parametrize("size", [(640, 480), (1280, 720), (66, 50)])
def test_the_pictures_are_the_cameras_in_every_format_and_size(bench, fourcc, size):
    from drivers.v4l2.fake_kernel import number_in, whole_picture  # noqa: PLC0415

    made = bench(camera(modes={fourcc: {size: (60,)}}, padding=32))
    made.grabber.open()
    with made.grabber.dequeue(1.0) as (one,):
        field = one.field
        assert (field.parity, field.y0, field.y_step) == (PROGRESSIVE, 0, 1)
        assert (field.luma == whole_picture(number_in(field.luma), *size)).all()


def test_the_middle_of_the_exposure_follows_the_start_that_is_stamped(bench):
    made = bench(size="640x480", rate_hz=30, exposure_ms=8)
    info = made.grabber.open()
    assert made.card.stamp_flags & abi.BUF_FLAG_TSTAMP_SRC_SOE
    with made.grabber.dequeue(1.0) as (one,):
        begin_ns = made.card.time_of(made.card.unit - 1)
        assert one.time_ns == pytest.approx(begin_ns + 4_000_000, abs=2_000)
    assert info.time_sigma_ns == 3_000_000


def test_an_exposure_longer_than_the_period_is_refused(bench):
    assert "0 to 16.7 ms" in refusal(bench(size="640x480", rate_hz=60, exposure_ms=20)).message
