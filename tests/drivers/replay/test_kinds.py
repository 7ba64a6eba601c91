"""Kinds of pictures, told by their size or by the option: what a size alone does not tell is asked for."""

import numpy as np
import pytest

from drivers.replay.pictures import frames, luma
from drivers.replay.playing import play, rows
from grabberd.errors import DeviceRefused
from grabberd_replay import ReplayGrabber


def test_frames_of_525_lines_have_their_own_rate(tmp_path):
    info, played, _ = play(frames(tmp_path, lines=480))
    assert (info.standard, info.field_rows) == ("NTSC", 240)
    assert played[1].time_ns == round(1001 / 60_000 * 1e9)


@pytest.mark.parametrize("size", [(480, 640), (576, 1024), (1080, 1920)])
def test_pictures_that_may_be_frames_or_progressive_need_to_be_told_what_they_are(tmp_path, size):
    frames(tmp_path, lines=size[0], columns=size[1])
    with pytest.raises(DeviceRefused, match=f"{size[1]}x{size[0]} may be interlaced frames or progressive"):
        ReplayGrabber(tmp_path).open()
    assert ReplayGrabber(tmp_path, pictures="frames").open().field_order == "top_first"


def test_pictures_of_no_video_standard_are_progressive_and_need_a_rate(tmp_path):
    frames(tmp_path, lines=100, columns=64)
    with pytest.raises(DeviceRefused, match="how many progressive pictures there are a second"):
        ReplayGrabber(tmp_path).open()
    info, played, _ = play(tmp_path, rate_hz=120)
    assert rows(played) == [(2, 0, 1), (2, 0, 1), (2, 0, 1)]
    assert (info.field_order, info.field_rows, info.rate_hz, info.standard) == ("progressive", 100, 120.0, "")
    assert [one.time_ns for one in played] == [round(n * 1e9 / 120) for n in range(3)]
    assert len(play(tmp_path, pictures="frames")[1]) == 6
    assert len(play(tmp_path, pictures="fields")[1]) == 3


def test_frames_have_an_even_number_of_lines(tmp_path):
    frames(tmp_path, lines=575)
    with pytest.raises(DeviceRefused, match="even number of lines"):
        ReplayGrabber(tmp_path, pictures="frames").open()


def test_doubled_fields_are_played_as_doubled(tmp_path):
    info, played, _ = play(frames(tmp_path), pictures="doubled")
    assert rows(played) == [(0, 0, 1), (1, 0, 1), (0, 0, 1)]
    np.testing.assert_array_equal(played[1].field.luma, luma(1))
    assert info.field_rows == 576
