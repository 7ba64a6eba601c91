"""What a node tells of itself when it is asked, without being disturbed."""

import errno

import pytest

from drivers.v4l2.fake_kernel import Camera, Card, FakeKernel
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.discovery import ask
from grabberd_v4l2.node import Node


@pytest.fixture
def kernel():
    return FakeKernel()


def answers(kernel, **card):
    kernel.add("/dev/video0", Card(**card))
    return ask(kernel, "/dev/video0")


def test_a_card_answers_for_all_its_inputs_formats_and_field_orders(kernel):
    told = answers(kernel, driver="bttv", formats=("RGB3", "YUYV", "GREY"))
    assert (told.kernel_driver, told.captures) == ("bttv", True)
    assert told.inputs == ("Television", "Composite", "S-Video")
    assert (told.standards, told.at_50_hz, told.standard_now) == (("PAL", "PAL-M", "NTSC"), True, "NTSC")
    assert (told.formats, told.other_formats) == (("GREY", "YUYV"), ("RGB3",))
    assert set(told.field_orders) == {Arrangement.INTERLACED, Arrangement.ALTERNATE, Arrangement.SEQ_TB}


def test_asking_changes_nothing_and_lets_go(kernel):
    card = kernel.add("/dev/video0", Card())
    before = (card.input, card.standard, bytes(card.pix))
    ask(kernel, "/dev/video0")
    assert (card.input, card.standard, bytes(card.pix)) == before
    assert kernel.descriptors == {}
    assert not {"S_FMT", "S_STD", "S_INPUT", "REQBUFS", "STREAMON"} & set(kernel.calls)


def test_a_card_that_streams_for_somebody_else_answers_all_the_same(kernel):
    idle = answers(kernel)
    other = Node(kernel, "/dev/video0")
    other.request_buffers(8)
    other.stream_on()
    assert ask(kernel, "/dev/video0") == idle


def test_a_node_without_pictures_is_asked_no_further(kernel):
    told = answers(kernel, caps=abi.CAP_META_CAPTURE)
    assert not told.captures
    assert "ENUM_FMT" not in kernel.calls


def test_a_camera_has_no_standards(kernel):
    told = answers(kernel, standards={}, orders=(Arrangement.NONE,))
    assert (told.standards, told.at_50_hz) == ((), False)


@pytest.mark.parametrize("call", ["G_STD", "TRY_FMT"])
def test_a_question_that_is_refused_has_no_answer(kernel, call):
    card = kernel.add("/dev/video0", Card())
    card.answers[call].extend([errno.EINVAL] * 20)
    told = ask(kernel, "/dev/video0")
    assert told.captures
    assert not (told.standard_now if call == "G_STD" else told.field_orders)


def test_a_card_that_goes_away_meanwhile_cannot_be_asked(kernel):
    card = kernel.add("/dev/video0", Card())
    card.answers["ENUM_FMT"].append(errno.ENODEV)
    with pytest.raises(OSError, match="ENUM_FMT"):
        ask(kernel, "/dev/video0")
    assert kernel.descriptors == {}


@pytest.mark.parametrize(
    "modes", [{(0, 480): (30,)}, {(640, 480): (10**7,)}, {(640, 480): (1,)}, {(641, 479): (30,)}]
)
def test_a_camera_none_of_whose_pictures_can_be_taken_is_known_by_its_answers(kernel, modes):
    kernel.add("/dev/video0", Camera(modes={"MJPG": modes}))
    assert not ask(kernel, "/dev/video0").can_be_taken
    kernel.add("/dev/video1", Camera(modes={"MJPG": modes, "YUYV": {(640, 480): (30,)}}))
    assert ask(kernel, "/dev/video1").can_be_taken
