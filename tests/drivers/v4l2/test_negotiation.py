"""What is asked of a card, in which order, and what its answers are taken for."""

import errno

import pytest

from drivers.v4l2.bench import ALL_ORDERS, Bench, card_with, dongle, pci_card
from grabberd.core.field import FieldOrder
from grabberd.errors import Cause, DeviceRefused
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement

UVC = "uvcvideo"


@pytest.fixture
def bench(tmp_path):
    def make(card=None, **options):
        return Bench(tmp_path, card, **options)

    return make


def refusal(bench):
    with pytest.raises(DeviceRefused) as caught:
        bench.grabber.open()
    assert caught.value.hint
    assert bench.nothing_is_left_behind()
    return caught.value


def set_order(bench):
    return bench.card.order


def test_input_standard_and_format_come_in_this_order_and_before_the_buffers(bench):
    made = bench()
    made.grabber.open()
    setting = [name for name in made.kernel.calls if name.startswith(("S_", "REQBUFS", "STREAMON"))]
    assert setting == ["S_INPUT", "S_STD", "S_FMT", "REQBUFS", "STREAMON"]


def test_everything_that_is_set_is_read_back_before_the_next_is_set(bench):
    made = bench()
    made.grabber.open()
    calls = made.kernel.calls
    for set_, read in (("S_INPUT", "G_INPUT"), ("S_STD", "G_STD"), ("S_FMT", "G_FMT")):
        assert calls[calls.index(set_) + 1] == read


def test_a_card_that_starts_in_ntsc_is_set_to_pal(bench):
    made = bench()
    assert not made.card.standard & abi.STD_PAL
    assert made.grabber.open().standard == "PAL"
    assert made.card.standard == abi.STD_PAL


def test_another_standard_of_50_hz_can_be_had(bench):
    made = bench(standard="PAL-B/G")
    assert made.grabber.open().standard == "PAL-BG"


@pytest.mark.parametrize(
    ("options", "socket"), [({}, 1), ({"input": "s-video"}, 2), ({"input": 0}, 0), ({"input": "2"}, 2)]
)
def test_the_input_is_that_of_the_options_or_the_first_that_is_no_tuner(bench, options, socket):
    made = bench(**options)
    made.grabber.open()
    assert made.card.input == socket


def test_an_input_without_standards_is_not_chosen_by_itself(bench):
    made = bench(card_with(sockets=(("HDMI", 2), ("Composite", 2))))
    made.grabber.open()
    assert made.card.input == 1


NUMBERED_SOCKETS = (("S-Video 0", 2), ("Composite 0", 2), ("Composite 1", 2))


def test_the_beginning_of_an_inputs_name_is_enough_where_it_is_one_inputs_only(bench):
    made = bench(card_with(sockets=NUMBERED_SOCKETS), input="s-video")
    made.grabber.open()
    assert made.card.input == 0


def test_the_beginning_of_several_names_is_none(bench):
    assert "Composite 1" in refusal(bench(card_with(sockets=NUMBERED_SOCKETS), input="Composite")).hint


def test_single_grey_fields_are_taken_where_a_card_has_them(bench):
    made = bench()
    info = made.grabber.open()
    assert (info.field_order, info.pixel_format) == (FieldOrder.ALTERNATE, "GREY")
    assert (info.columns, info.field_rows, info.rate_hz, info.buffers) == (720, 288, 50.0, 16)


@pytest.mark.parametrize("order", [order.name.lower() for order in ALL_ORDERS])
@pytest.mark.parametrize("fourcc", ["GREY", "YUYV", "UYVY", "NV12"])
def test_every_field_order_and_format_can_be_asked_for(bench, order, fourcc):
    made = bench(field_order=order, format=fourcc)
    info = made.grabber.open()
    assert info.pixel_format == fourcc
    assert info.details["field order of the driver"] == order.upper()
    assert set_order(made) == Arrangement[order.upper()]


def test_one_parity_alone_is_taken_last_and_said(bench):
    made = bench(card_with(driver="unheard_of", orders=(Arrangement.BOTTOM,)))
    info = made.grabber.open()
    assert (info.field_order, info.rate_hz) == (FieldOrder.ONE_PARITY, 25.0)
    assert any("25 fields a second" in remark for remark in info.remarks)


def test_what_a_profile_says_of_the_older_field_can_be_overruled(bench):
    assert bench(pci_card("tw68"), older_field="bottom").grabber.open().field_order is FieldOrder.BOTTOM_FIRST


def test_usbtvs_bottom_fields_are_the_older(bench):
    assert bench(dongle(driver="usbtv")).grabber.open().field_order is FieldOrder.BOTTOM_FIRST


def test_another_order_than_the_best_one_is_believed_when_it_is_granted(bench):
    made = bench(card_with(orders=(Arrangement.INTERLACED_BT,)))
    info = made.grabber.open()
    assert info.field_order is FieldOrder.BOTTOM_FIRST
    assert set_order(made) == Arrangement.INTERLACED_BT


def test_what_is_believed_is_what_the_card_is_left_with(bench):
    def grey_alone_is_of_use(pix):
        pix.field = Arrangement.INTERLACED_BT
        if pix.pixelformat != abi.fourcc("GREY"):
            pix.height = 240

    made = bench(card_with(tampers=grey_alone_is_of_use))
    info = made.grabber.open()
    assert (info.pixel_format, info.field_rows) == ("GREY", 288)
    assert (made.card.pix.pixelformat, made.card.pix.height) == (abi.fourcc("GREY"), 576)


def test_another_width_is_reported_as_granted(bench):
    assert bench(card_with(columns=704)).grabber.open().columns == 704


def test_a_card_that_does_not_tell_its_line_length_has_no_padding(bench):
    made = bench(card_with(tampers=lambda pix: setattr(pix, "bytesperline", 0)))
    made.grabber.open()
    with made.grabber.dequeue(1.0) as fields:
        assert fields[0].field.luma.shape == (288, 720)


@pytest.mark.parametrize(
    ("tampers", "said"),
    [
        (lambda pix: setattr(pix, "field", Arrangement.ANY), "ANY"),
        (lambda pix: setattr(pix, "field", Arrangement.NONE), "NONE"),
        (lambda pix: setattr(pix, "field", 42), "field 42"),
        (lambda pix: setattr(pix, "height", 240), "720×240"),
        (lambda pix: setattr(pix, "width", 320), "320×"),
        (lambda pix: setattr(pix, "pixelformat", abi.fourcc("MJPG")), "MJPG"),
    ],
)
def test_a_card_that_grants_nothing_of_use_is_refused_with_its_answers(bench, tampers, said):
    told = refusal(bench(card_with(tampers=tampers)))
    assert "it grants" in told.message
    assert said in told.message


def test_a_field_order_that_is_asked_for_is_had_or_refused(bench):
    told = refusal(bench(card_with(orders=(Arrangement.INTERLACED,)), field_order="alternate"))
    assert "ALTERNATE" in told.message
    assert "field_order" in told.hint


def test_a_card_without_our_formats_is_refused(bench):
    told = refusal(bench(card_with(formats=("MJPG", "RGB3"))))
    assert "MJPG, RGB3" in told.message


def test_an_input_that_is_not_there_is_refused_with_those_that_are(bench):
    told = refusal(bench(input="SCART"))
    assert "1 (Composite)" in told.hint


def test_a_card_without_inputs_is_refused(bench):
    assert "no inputs" in refusal(bench(card_with(sockets=()))).message


@pytest.mark.parametrize(("known", "said"), [({"NTSC": 0x1000}, "NTSC"), ({}, "none at all")])
def test_a_card_without_pal_is_refused(bench, known, said):
    told = refusal(bench(card_with(standards=known), standard="PAL"))
    assert "no PAL" in told.message
    assert said in told.message
    assert ("standard: NTSC" in told.hint) == bool(known)


def test_a_card_that_stays_in_ntsc_is_refused(bench):
    made = bench()
    made.card.set_standard = lambda standard: None
    assert "60 Hz" in refusal(made).message


def test_a_camera_of_60_hz_is_refused_within_a_second(bench):
    made = bench()
    made.card.camera = 0x1000
    before_ns = made.kernel.time_ns
    told = refusal(made)
    assert "60 Hz (NTSC)" in told.message
    assert made.kernel.time_ns - before_ns < 1_000_000_000


def test_a_decoder_that_takes_a_moment_to_see_pal_is_waited_for(bench):
    made = bench()
    made.card.camera = 0x1000
    made.kernel.after(0.15, lambda: made.card.set_camera(abi.STD_PAL))
    made.grabber.open()


def test_a_card_without_a_camera_can_be_opened(bench):
    made = bench()
    made.card.camera = 0
    made.grabber.open()


def test_a_stick_that_throws_fields_away_is_refused_with_advice(bench):
    told = refusal(bench(dongle(driver=UVC, orders=(Arrangement.NONE,)), usb_id="534d:0021"))
    assert "throws one field" in told.message
    assert "Bt878" in told.hint


@pytest.mark.parametrize(
    ("caps", "said"),
    [
        (abi.CAP_META_CAPTURE | abi.CAP_STREAMING, "metadata"),
        (abi.CAP_VBI_CAPTURE | abi.CAP_STREAMING, "VBI"),
        (abi.CAP_RADIO, "radio"),
        (abi.CAP_VIDEO_OUTPUT | abi.CAP_STREAMING, "output"),
        (0, "something else"),
        (abi.CAP_VIDEO_CAPTURE_MPLANE | abi.CAP_STREAMING, "several planes"),
        (abi.CAP_VIDEO_CAPTURE, "cannot stream"),
    ],
)
def test_a_node_that_is_not_for_pictures_is_refused_by_what_it_is(bench, caps, said):
    assert said in refusal(bench(card_with(caps=caps))).message


@pytest.mark.parametrize(
    ("call", "answer", "said", "advice", "cause"),
    [
        ("open", errno.EBUSY, "in use", "fuser", Cause.DEVICE_BUSY),
        ("open", errno.EACCES, "by this user", "video", Cause.NO_RIGHTS),
        ("open", errno.EPERM, "by this user", "udev", Cause.NO_RIGHTS),
        ("QUERYCAP", errno.ENOTTY, "not a video device", "grabberd devices", Cause.DEVICE_REFUSED),
        ("S_STD", errno.EBUSY, "in use", "fuser", Cause.DEVICE_BUSY),
        ("S_FMT", errno.EBUSY, "in use", "fuser", Cause.DEVICE_BUSY),
        ("REQBUFS", errno.EBUSY, "in use", "fuser", Cause.DEVICE_BUSY),
        ("REQBUFS", errno.ENOMEM, "memory", "buffers", Cause.DEVICE_REFUSED),
        ("STREAMON", errno.EBUSY, "in use", "fuser", Cause.DEVICE_BUSY),
        ("STREAMON", errno.ENOSPC, "bandwidth", "one dongle", Cause.NO_BANDWIDTH),
        ("STREAMON", errno.EINVAL, "refuses", "v4l2-ctl", Cause.DEVICE_REFUSED),
    ],
)
def test_a_refusal_of_the_kernel_says_what_to_do(bench, call, answer, said, advice, cause):
    made = bench()
    made.card.answers[call].append(answer)
    told = refusal(made)
    assert said in told.message
    assert advice in told.hint
    assert told.cause is cause


def test_a_format_that_is_refused_outright_is_passed_over(bench):
    made = bench()
    made.card.answers["S_FMT"].append(errno.EINVAL)
    assert made.grabber.open().pixel_format == "NV12"


@pytest.mark.parametrize(("most", "fewest", "granted"), [(4, 1, 4), (32, 20, 20), (32, 1, 16)])
def test_as_many_buffers_are_used_as_are_granted(bench, most, fewest, granted):
    made = bench(card_with(most_buffers=most, fewest_buffers=fewest))
    info = made.grabber.open()
    assert info.buffers == granted
    assert len(made.card.queue.waiting) == granted
    assert any("only 4 buffers" in remark for remark in info.remarks) == (granted == 4)


def test_a_single_buffer_is_too_few(bench):
    assert "grants 1 buffers" in refusal(bench(card_with(most_buffers=1))).message


def test_buffers_that_are_too_small_are_refused(bench):
    told = refusal(bench(card_with(tampers=lambda pix: setattr(pix, "sizeimage", 4096))))
    assert "4096 bytes" in told.message


def test_a_broken_profile_is_named_and_the_built_in_one_used(bench, tmp_path):
    (tmp_path / "profiles.d").mkdir()
    (tmp_path / "profiles.d" / "mine.yaml").write_text("driver: bttv\nolder: sideways\n")
    info = bench().grabber.open()
    assert info.field_order is FieldOrder.ALTERNATE
    assert any("mine.yaml" in remark for remark in info.remarks)


def test_two_dongles_on_one_bus_are_remarked_on(bench):
    made = bench(dongle())
    made.computer.plug_dongle(5, port="1-3")
    assert any("shares USB bus" in remark for remark in made.grabber.open().remarks)
