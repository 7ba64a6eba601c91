"""Video files are played like folders of their pictures, or refused by name."""

import subprocess
import sys
import weakref

import cv2
import numpy as np
import pytest

from drivers.replay.pictures import luma
from drivers.replay.playing import PERIOD_NS, play, rows
from drivers.replay.videos import avi, coded, packed, uncompressed, y4m
from grabberd.core.field import FieldOrder
from grabberd.errors import DeviceRefused, PictureError, StreamEnded
from grabberd_replay import ReplayGrabber
from grabberd_replay.decoder import LAYOUTS
from instrument.acquisition.streams import numbers

PICTURES = [luma(n) for n in range(3)]
SMOOTH = [cv2.GaussianBlur(picture, (0, 0), 3) for picture in PICTURES]


# --- what is in it ---


@pytest.mark.parametrize(
    "write",
    [
        avi,
        y4m,
        lambda path: packed(path, b"UYVY"),
        lambda path: packed(path, b"YUY2"),
        lambda path: coded(path.with_suffix(".mkv"), "FFV1", PICTURES),
        lambda path: coded(path, "FFV1", PICTURES),
        lambda path: coded(path, "MPNG", PICTURES),
    ],
    ids=["grey", "interlaced y4m", "UYVY", "YUY2", "FFV1 in Matroska", "FFV1 in AVI", "PNG"],
)
def test_a_woven_video_without_loss_comes_back_bit_for_bit(tmp_path, write):
    info, played, end = play(write(tmp_path / "clip.avi"))
    assert isinstance(end, StreamEnded)
    assert rows(played) == [(0, 0, 2), (1, 1, 2)] * 3
    for n, grabbed in enumerate(played):
        np.testing.assert_array_equal(grabbed.field.luma, luma(n // 2)[n % 2 :: 2])
    assert (info.columns, info.field_rows, info.rate_hz) == (720, 288, 50.0)
    assert info.standard == "PAL"
    assert all(one.startswith(("Nothing tells which field", "YUV4MPEG has no times")) for one in info.remarks)


def test_frames_of_25_a_second_are_fields_of_50_by_their_own_times(tmp_path):
    _, played, _ = play(avi(tmp_path / "clip.avi"))
    assert [f.time_ns for f in played] == [n * PERIOD_NS for n in range(6)]
    assert [f.sequence for f in played] == list(range(6))


def test_the_bottom_field_can_be_the_older(tmp_path):
    info, played, _ = play(avi(tmp_path / "clip.avi"), field_order="bottom_first")
    assert rows(played) == [(1, 1, 2), (0, 0, 2)] * 3
    assert info.field_order is FieldOrder.BOTTOM_FIRST


def test_pictures_of_288_lines_at_50_a_second_are_single_fields(tmp_path):
    info, played, _ = play(avi(tmp_path / "clip.avi", lines=288, rate=(50, 1)), first_parity="bottom")
    assert [f.field.parity for f in played] == [1, 0, 1]
    assert [f.time_ns for f in played] == [n * PERIOD_NS for n in range(3)]
    assert (info.rate_hz, info.remarks) == (50.0, ())


def test_pictures_that_may_be_frames_or_progressive_need_to_be_told_what_they_are(tmp_path):
    path = avi(tmp_path / "clip.avi", lines=480, columns=640)
    with pytest.raises(DeviceRefused, match=r"clip\.avi: pictures of 640x480 may be interlaced frames"):
        ReplayGrabber(path).open()


def test_pictures_of_no_video_standard_are_progressive_at_the_video_s_own_rate(tmp_path):
    path = avi(tmp_path / "clip.avi", lines=100, columns=64)
    info, played, _ = play(path)
    assert (info.field_order, info.rate_hz, info.remarks) == ("progressive", 25.0, ())
    assert rows(played) == [(2, 0, 1)] * 3
    assert len(play(path, pictures="frames")[1]) == 6
    assert len(play(path, pictures="fields")[1]) == 3
    assert len(play(path, pictures="doubled")[1]) == 3


def test_it_can_be_played_again_from_the_beginning(tmp_path):
    grabber = ReplayGrabber(avi(tmp_path / "clip.avi"))
    for _ in range(2):
        grabber.open()
        with grabber.dequeue(0) as fields:
            np.testing.assert_array_equal(fields[0].field.luma, luma(0)[0::2])
    grabber.close()


def test_pictures_that_were_played_are_not_kept(tmp_path):
    grabber = ReplayGrabber(avi(tmp_path / "clip.avi", 20, 48, 64), pictures="frames")
    grabber.open()
    played = []
    for _ in range(20):
        with grabber.dequeue(0) as fields:
            played.append(weakref.ref(fields[0].field.luma))
        del fields
        assert sum(kept() is not None for kept in played) <= 2


# --- gaps and rates ---


def test_pictures_that_the_recorder_dropped_are_lost_fields(tmp_path):
    pictures = [luma(n, 48, 64).tobytes() for n in range(5)]
    pictures[2] = b""
    path = uncompressed(tmp_path / "clip.avi", pictures, b"Y800", 48, 64)
    info, played, _ = play(path, pictures="frames")
    found = numbers(played, info)
    assert [f.n for f in found] == [0, 1, 2, 3, 6, 7, 8, 9]
    assert found[4].lost_before[0].count == 2
    np.testing.assert_array_equal(played[4].field.luma, luma(3, 48, 64)[0::2])


def test_a_container_that_has_a_rate_but_no_times_says_that_dropped_pictures_leave_no_trace(tmp_path):
    info, played, _ = play(y4m(tmp_path / "clip.y4m"))
    assert "YUV4MPEG has no times: its pictures are taken for consecutive ones." in info.remarks
    assert info.rate_hz == 50.0
    assert [one.time_ns for one in played] == [n * PERIOD_NS for n in range(6)]


def test_ntsc_keeps_its_own_rate(tmp_path):
    info, played, _ = play(avi(tmp_path / "clip.avi", lines=480, rate=(30_000, 1001)))
    assert info.rate_hz == pytest.approx(59.94, abs=0.001)
    assert played[5].time_ns == pytest.approx(5e9 / 59.94, rel=1e-5)
    assert info.standard == "NTSC"


def test_deinterlaced_video_is_said_to_be_too_fast_and_how_to_play_it(tmp_path):
    path = avi(tmp_path / "clip.avi", rate=(50, 1))
    remarks = " ".join(ReplayGrabber(path).open().remarks)
    assert "100 fields a second" in remarks
    assert "'doubled'" in remarks
    info, played, _ = play(path, pictures="doubled", first_parity="top")
    assert rows(played) == [(0, 0, 1), (1, 0, 1), (0, 0, 1)]
    assert info.rate_hz == 50.0


def test_a_wrong_rate_can_be_put_right(tmp_path):
    info, played, _ = play(avi(tmp_path / "clip.avi", rate=(30, 1)), rate_hz=50)
    assert info.rate_hz == 50.0
    assert [f.time_ns for f in played] == [n * PERIOD_NS for n in range(6)]


# --- what is lost in it ---


def test_a_lossy_codec_is_named(tmp_path):
    info, played, _ = play(coded(tmp_path / "clip.avi", "MJPG", SMOOTH))
    assert info.details["codec"].lower() in {"mjpg", "mjpeg"}
    assert "is usually lossy" in info.remarks[0]
    assert len(played) == 6


def test_grey_values_of_colours_are_said_to_be_computed(tmp_path):
    path = tmp_path / "clip.avi"
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*"FFV1"), 25.0, (720, 576))
    for picture in PICTURES:
        writer.write(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    writer.release()
    info, played, _ = play(path)
    assert "Rec. 601" in info.details["luma"]
    np.testing.assert_array_equal(played[0].field.luma, luma(0)[0::2])


def test_where_the_luma_is_among_the_bytes_of_a_picture():
    assert all(layout.first < layout.step <= layout.bytes_per_pixel for layout in LAYOUTS.values())


# --- what is no video, or a broken one ---


@pytest.mark.parametrize("fourcc", ["FFV1", "MJPG", None])
@pytest.mark.parametrize("part", [0.5, 0.6])
def test_a_truncated_video_is_played_as_far_as_it_goes(tmp_path, fourcc, part):
    path = tmp_path / "clip.avi"
    avi(path, 6) if fourcc is None else coded(path, fourcc, [*SMOOTH, *SMOOTH])
    _, whole, _ = play(path)
    data = path.read_bytes()
    path.write_bytes(data[: int(part * len(data))])
    _, played, error = play(path)
    assert isinstance(error, PictureError)
    told = (f"ends after {len(played) // 2} of 6 pictures", f"at {len(played) // 2 / 25:.3f} s is damaged")
    assert any(words in error.message for words in told)
    assert 4 <= len(played) <= 6
    for one, other in zip(whole, played, strict=False):
        np.testing.assert_array_equal(one.field.luma, other.field.luma)


@pytest.mark.parametrize("kept", [16, 100, 250])
def test_a_video_that_is_cut_off_in_its_head_is_refused(tmp_path, kept):
    path = avi(tmp_path / "clip.avi")
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises((DeviceRefused, PictureError), match=r"clip\.avi") as caught:
        ReplayGrabber(path).open()
    assert caught.value.hint


def test_a_video_without_pictures_is_told_at_once(tmp_path):
    with pytest.raises(PictureError, match="no picture of a video"):
        ReplayGrabber(avi(tmp_path / "clip.avi", 0)).open()


def test_a_codec_that_nobody_knows_is_refused(tmp_path):
    path = uncompressed(tmp_path / "clip.avi", [luma(0, 48, 64).tobytes()], b"XYZ1", 48, 64)
    with pytest.raises(DeviceRefused, match="codec that OpenCV does not know") as caught:
        ReplayGrabber(path, pictures="frames").open()
    assert "ffmpeg -i clip.avi" in caught.value.hint


def test_coded_pictures_that_never_change_are_not_believed(tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", "")
    path = coded(tmp_path / "clip.avi", "FFV1", [luma(0)] * 3)
    with pytest.raises(DeviceRefused, match="identical bit for bit") as caught:
        ReplayGrabber(path).open()
    assert "sudo apt-get install ffmpeg" in caught.value.hint


@pytest.mark.parametrize(
    "content", [b"a text\n" * 99, b"", b"RIFF\4\0\0\0WAVE", b"#EXTM3U\nclip.ts\n", b"\x89PNG\r\n\x1a\n"]
)
@pytest.mark.parametrize("name", ["clip.avi", "clip.txt"])
def test_another_kind_of_file_is_refused_whatever_its_name(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(DeviceRefused, match="it is no video") as caught:
        ReplayGrabber(path).open()
    assert "AVI" in caught.value.hint


@pytest.mark.parametrize("fourcc", ["MJPG", "MPNG"])
def test_nothing_is_said_on_stderr(tmp_path, fourcc):
    path = coded(tmp_path / "clip.avi", fourcc, SMOOTH)
    data = path.read_bytes()
    path.write_bytes(data[: int(0.8 * len(data))] + bytes(2000) + data[int(0.8 * len(data)) + 2000 : -2000])
    program = (
        "import sys; from grabberd_replay import ReplayGrabber; from grabberd.errors import PictureError\n"
        "grabber = ReplayGrabber(sys.argv[1]); grabber.open()\n"
        "try:\n    while True:\n        with grabber.dequeue(0): pass\n"
        "except PictureError: print('ended')\n"
    )
    done = subprocess.run([sys.executable, "-c", program, path], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("ended\n", "")


@pytest.mark.parametrize("size", [{"columns": 5000, "lines": 576}, {"columns": 16, "lines": 4098}])
def test_pictures_that_no_grabber_gives_are_refused_by_their_header(tmp_path, size):
    clip = avi(tmp_path / "clip.avi", count=1, **size)
    with pytest.raises(
        DeviceRefused, match=f"pictures of {size['columns']}x{size['lines']}, expected at most"
    ):
        ReplayGrabber(clip).open()
