"""Coded videos are read by the program `ffmpeg`: interlaced ones in the order that they are marked with."""

import shutil
import subprocess
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from drivers.replay.pictures import luma
from drivers.replay.playing import play, rows
from drivers.replay.videos import by_ffmpeg, coded, needs_ffmpeg, spoil, uncompressed, y4m
from grabberd.core.field import FieldOrder
from grabberd.errors import DeviceRefused, PictureError, StreamEnded
from grabberd_replay import ReplayGrabber
from grabberd_replay.video import container_of

pytestmark = needs_ffmpeg

PICTURES = [luma(n) for n in range(4)]
SMALL = [luma(n, 64, 64) for n in range(120)]
SMOOTH = [cv2.GaussianBlur(luma(n), (0, 0), 3) for n in range(8)]
FLAGS = ("-flags", "+ilme+ildct")
KINDS = {
    "dv.avi": ("bff", "-pix_fmt", "yuv420p", "-c:v", "dvvideo"),
    "raw.dv": ("bff", "-pix_fmt", "yuv420p", "-c:v", "dvvideo"),
    "mpeg2.mpg": ("tff", "-pix_fmt", "yuv420p", "-c:v", "mpeg2video", *FLAGS, "-top", "1", "-q:v", "2"),
    "mpeg2.ts": ("bff", "-pix_fmt", "yuv420p", "-c:v", "mpeg2video", *FLAGS, "-top", "0", "-q:v", "2"),
    "h264-top.mp4": ("tff", "-pix_fmt", "yuv420p", "-c:v", "libx264", *FLAGS, "-qp", "10"),
    "h264-bottom.mkv": ("bff", "-pix_fmt", "yuv420p", "-c:v", "libx264", *FLAGS, "-x264opts", "bff=1"),
    "ffv1.mkv": ("tff", "-c:v", "ffv1", *FLAGS),
}


def interlaced(path: Path, pictures=SMOOTH) -> Path:
    order, *options = KINDS[path.name]
    return by_ffmpeg(path, pictures, "-vf", f"setfield={order}", *options)


def worst(played, pictures, order: str) -> float:
    """Largest mean difference between the fields that were played and those of the pictures."""
    first = 0 if order == "tff" else 1
    return max(
        float(np.abs(one.field.luma.astype(int) - pictures[n // 2][(n + first) % 2 :: 2]).mean())
        for n, one in enumerate(played)
    )


# --- the order of fields ---


@pytest.mark.parametrize("name", KINDS)
def test_fields_come_in_the_order_that_the_video_is_marked_with(tmp_path, name):
    order = KINDS[name][0]
    info, played, end = play(interlaced(tmp_path / name))
    assert isinstance(end, StreamEnded)
    assert (info.field_order, info.rate_hz) == ({"tff": "top_first", "bff": "bottom_first"}[order], 50.0)
    assert [one.field.parity for one in played] == [0, 1] * 8 if order == "tff" else [1, 0] * 8
    assert [one.time_ns for one in played] == [n * 20_000_000 for n in range(16)]
    # Luma of video without loss is from 16 to 235, as it was coded; it is within the losses of the codec.
    scaled = SMOOTH if name == "ffv1.mkv" else [16 + one * (219 / 255) for one in SMOOTH]
    assert worst(played, scaled, order) < 3.0


def test_a_codec_without_loss_comes_back_bit_for_bit(tmp_path):
    info, played, _ = play(interlaced(tmp_path / "ffv1.mkv", PICTURES))
    assert worst(played, PICTURES, "tff") == 0.0
    assert (info.details["luma"], info.remarks) == ("as it was coded", ())


@pytest.mark.skipif(shutil.which("mkvpropedit") is None, reason="sudo apt-get install mkvtoolnix")
@pytest.mark.parametrize(
    ("field_order", "read"), [("1", FieldOrder.TOP_FIRST), ("6", FieldOrder.BOTTOM_FIRST)]
)
def test_the_mark_of_a_matroska_file_can_be_put_right(tmp_path, field_order, read):
    path = by_ffmpeg(tmp_path / "a.mkv", PICTURES, "-c:v", "ffv1")
    marks = ["--set", "interlaced=1", "--set", f"field-order={field_order}"]
    subprocess.run(["mkvpropedit", "--quiet", str(path), "--edit", "track:v1", *marks], check=True)
    info, played, _ = play(path)
    assert (info.details["marked"], info.field_order) == (str(read), read)
    assert not any("Nothing tells" in one for one in info.remarks)
    assert worst(played, PICTURES, "tff" if read is FieldOrder.TOP_FIRST else "bff") == 0.0


@pytest.mark.parametrize("codec", [("huffyuv", "yuv422p"), ("utvideo", "yuv422p"), ("rawvideo", "gray")])
def test_an_order_that_nothing_tells_is_said(tmp_path, codec):
    path = by_ffmpeg(tmp_path / "a.avi", PICTURES, "-c:v", codec[0], "-pix_fmt", codec[1])
    info, _, _ = play(path)
    assert any("Nothing tells which field of a frame is the older" in one for one in info.remarks)
    info, _, _ = play(path, field_order="bottom_first")
    assert not any("Nothing tells" in one for one in info.remarks)


# --- samples: as stored, whatever reads them ---


RAW_DEEP = {
    "gray10.y4m": ("gray10le", 10), "gray12.y4m": ("gray12le", 12), "gray16.y4m": ("gray16le", 16),
    "gray10.nut": ("gray10le", 10), "gray14.nut": ("gray14le", 14), "gray16.nut": ("gray16le", 16),
    "big.nut": ("gray16be", 16), "colour.y4m": ("yuv420p10le", 10), "colour.nut": ("yuv422p12le", 12),
}  # fmt: skip


def raw_deep(path: Path, pixels: str, bits: int) -> np.ndarray:
    """A raw video of one picture with every value that so many bits have, written without any filter."""
    values = (np.arange(64 * 1024).reshape(64, 1024) % (1 << bits)).astype(np.uint16)
    content = values.astype(">u2" if pixels.endswith("be") else "<u2").tobytes()
    chroma = {"yuv420": values.size // 2, "yuv422": values.size}.get(pixels[:6], 0)
    content += np.full(chroma, 1 << (bits - 1), "<u2").tobytes()
    form = ["-f", "rawvideo", "-pix_fmt", pixels, "-s", "1024x64", "-r", "25"]
    out = ["-c:v", "wrapped_avframe" if path.suffix == ".y4m" else "rawvideo", "-strict", "-1", str(path)]
    subprocess.run(["ffmpeg", "-v", "error", *form, "-i", "-", *out], input=content * 3, check=True)
    return values


@pytest.mark.parametrize("name", RAW_DEEP)
def test_uncompressed_video_of_more_than_8_bits_is_read_as_stored(tmp_path, monkeypatch, name):
    pixels, bits = RAW_DEEP[name]
    values = raw_deep(tmp_path / name, pixels, bits)
    info, played, _ = play(tmp_path / name, pictures="progressive")
    assert info.details["samples"] == f"the upper 8 of {bits} bits"
    np.testing.assert_array_equal(played[0].field.luma, values >> (bits - 8))
    monkeypatch.setenv("PATH", "")
    with pytest.raises(DeviceRefused, match="only converted, not as they are stored") as caught:
        play(tmp_path / name, pictures="progressive")
    assert "apt-get install ffmpeg" in caught.value.hint


@pytest.mark.parametrize("installed", [True, False])
def test_pixel_formats_that_nut_has_no_name_for_are_refused(tmp_path, monkeypatch, installed):
    options = [
        "-f",
        "rawvideo",
        "-pix_fmt",
        "p010le",
        "-s",
        "64x64",
        "-r",
        "25",
        "-i",
        "-",
        "-c:v",
        "rawvideo",
    ]
    path = tmp_path / "a.nut"
    content = bytes(64 * 64 * 3 * 3)
    subprocess.run(["ffmpeg", "-v", "error", *options, str(path)], input=content, check=True)
    if not installed:
        monkeypatch.setenv("PATH", "")
    with pytest.raises(DeviceRefused, match=r"rgb555le|only converted"):
        play(path, pictures="progressive")


SAME = {
    "limited.mp4": ("-c:v", "libx264", "-qp", "0", "-pix_fmt", "yuv420p", "-color_range", "tv"),
    "full.mp4": ("-c:v", "libx264", "-qp", "0", "-pix_fmt", "yuv420p", "-color_range", "pc"),
    "full.avi": ("-c:v", "mjpeg", "-q:v", "2", "-pix_fmt", "yuvj420p"),
    "colours.mov": ("-c:v", "qtrle", "-pix_fmt", "rgb24"),
    "colours.mkv": ("-c:v", "ffv1", "-pix_fmt", "bgr0"),
}


def same_by_both(path: Path, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Remarks, after OpenCV alone has given the same pixels as `ffmpeg`."""
    info, by_ffmpeg_, _ = play(path, pictures="progressive")
    monkeypatch.setenv("PATH", "")
    _, by_opencv, _ = play(path, pictures="progressive")
    assert len(by_ffmpeg_) == len(by_opencv) == len(SMALL[:3])
    for one, other in zip(by_ffmpeg_, by_opencv, strict=True):
        np.testing.assert_array_equal(one.field.luma, other.field.luma)
    return list(info.remarks)


@pytest.mark.parametrize("name", SAME)
def test_the_same_pixels_come_whatever_reads_them(tmp_path, monkeypatch, name):
    same_by_both(by_ffmpeg(tmp_path / name, SMALL[:3], *SAME[name]), monkeypatch)


def test_a_mark_that_pictures_be_turned_is_not_followed_but_said(tmp_path, monkeypatch):
    path = by_ffmpeg(tmp_path / "a.mp4", SMALL[:3], *SAME["limited.mp4"])
    turned = ["-i", str(path), "-map", "1:v", "-c", "copy", "-metadata:s:v:0", "rotate=90"]
    turned = by_ffmpeg(tmp_path / "b.mp4", [luma(0, 16, 16)], *turned)
    assert any("be turned by" in one for one in same_by_both(turned, monkeypatch))


def test_an_order_that_is_given_is_taken_and_the_contradiction_told(tmp_path):
    info, played, _ = play(interlaced(tmp_path / "raw.dv"), field_order="top_first")
    assert [one.field.parity for one in played[:2]] == [0, 1]
    assert any("marked as bottom_first, but played as top_first" in one for one in info.remarks)


def test_what_is_marked_as_interlaced_need_not_be_told_so_whatever_its_size(tmp_path):
    pictures = [luma(n, 480, 640) for n in range(3)]
    path = by_ffmpeg(tmp_path / "a.mkv", pictures, "-vf", "setfield=bff", "-c:v", "ffv1", *FLAGS)
    info, played, _ = play(path)
    assert (info.field_order, info.field_rows) == (FieldOrder.BOTTOM_FIRST, 240)
    assert rows(played)[:2] == [(1, 1, 2), (0, 0, 2)]


def test_a_mark_as_progressive_is_no_proof(tmp_path):
    path = by_ffmpeg(tmp_path / "a.mkv", PICTURES, "-vf", "setfield=prog", "-c:v", "ffv1")
    info, _, _ = play(path)
    assert info.field_order == "top_first"
    assert any("marked as progressive" in one and "grabberd inspect" in one for one in info.remarks)
    small = by_ffmpeg(tmp_path / "b.mkv", [luma(0, 480, 640)] * 2, "-vf", "setfield=prog", "-c:v", "ffv1")
    with pytest.raises(DeviceRefused, match="may be interlaced frames or progressive"):
        ReplayGrabber(small).open()


def test_uncompressed_video_too_is_played_in_its_marked_order(tmp_path):
    path = y4m(tmp_path / "a.y4m")
    path.write_bytes(path.read_bytes().replace(b" It ", b" Ib ", 1))
    assert play(path)[0].field_order == "bottom_first"


def test_raw_dv_is_known_by_its_first_bytes(tmp_path):
    found = container_of(interlaced(tmp_path / "raw.dv"))
    assert found is not None
    assert (found.name, found.timed) == ("DV", False)


# --- grey values ---


def test_noise_in_the_colours_leaves_the_luma_alone(tmp_path):
    grey, rng = SMOOTH[:3], np.random.default_rng(1)
    planes = [
        one.tobytes() + rng.integers(0, 256, one.size // 2, np.uint8).tobytes()
        for one in (np.clip(picture, 16, 235) for picture in grey)
    ]
    path = tmp_path / "a.y4m"
    path.write_bytes(b"YUV4MPEG2 W720 H576 F25:1 Ip\n" + b"".join(b"FRAME\n" + one for one in planes))
    for video in (path, _recoded(path, tmp_path / "a.mkv")):
        info, played, _ = play(video)
        assert info.details["luma"] in {"as it was coded", "as it stands in the file"}
        for n, one in enumerate(played):
            np.testing.assert_array_equal(one.field.luma, np.clip(grey[n // 2], 16, 235)[n % 2 :: 2])


def _recoded(path, out):
    by_ffmpeg(out, [luma(0, 16, 16)], "-i", str(path), "-map", "1:v", "-c:v", "ffv1", "-pix_fmt", "yuv420p")
    return out


def test_of_ten_bits_the_upper_eight_are_used(tmp_path):
    deep = [(luma(n).astype(np.uint16) << 2) | 3 for n in range(3)]
    raw = ["-f", "rawvideo", "-pix_fmt", "gray10le", "-s", "720x576", "-r", "25"]
    content = tmp_path / "deep.raw"
    content.write_bytes(b"".join(one.astype("<u2").tobytes() for one in deep))
    path = tmp_path / "a.mkv"
    options = [*raw, "-i", str(content), "-map", "1:v", "-c:v", "ffv1", "-pix_fmt", "gray10le"]
    info, played, _ = play(by_ffmpeg(path, [luma(0, 16, 16)], *options))
    assert info.details["luma"] == "as it was coded"
    assert info.details["samples"] == "the upper 8 of 10 bits"
    np.testing.assert_array_equal(played[2].field.luma, luma(1)[0::2])


def test_colours_become_luma_and_that_is_said(tmp_path):
    pictures = [np.repeat(one[..., None], 3, axis=2) for one in PICTURES]
    info, played, _ = play(by_ffmpeg(tmp_path / "a.mkv", pictures, "-c:v", "ffv1", "-pix_fmt", "bgr0"))
    assert "by Rec. 601" in info.details["luma"]
    assert worst(played, PICTURES, "tff") == 0.0


# --- times ---


@pytest.mark.parametrize("installed", [True, False])
def test_a_rate_that_changes_ends_the_video_where_it_changes(tmp_path, monkeypatch, installed):
    times = "settb=1/1000,setpts=PTS+gte(N\\,70)*(N-70)*20"
    path = by_ffmpeg(
        tmp_path / "a.mkv", SMALL, "-vf", times, "-fps_mode", "passthrough", "-enc_time_base", "0.001",
        *("-c:v", "ffv1"),
    )  # fmt: skip
    if not installed:
        monkeypatch.setenv("PATH", "")
    _, played, error = play(path, pictures="frames")
    assert isinstance(error, PictureError)
    assert "no longer come 40 ms apart: its rate varies" in error.message
    assert "constant rate" in error.hint
    assert [one.sequence for one in played if one.damage is None][:140] == list(range(140))


def test_times_without_a_steady_rate_are_refused_at_once(tmp_path):
    times = "settb=1/1000,setpts=N*40+18*mod(N*N\\,3)-16*mod(N\\,2)"
    path = by_ffmpeg(
        tmp_path / "a.mkv", SMALL, "-vf", times, "-fps_mode", "passthrough", "-enc_time_base", "0.001",
        *("-c:v", "ffv1"),
    )  # fmt: skip
    with pytest.raises(DeviceRefused, match="ms apart, at no steady rate"):
        play(path, pictures="frames")


def test_pictures_that_were_dropped_are_lost_fields(tmp_path):
    path = by_ffmpeg(
        tmp_path / "a.mkv", SMOOTH, "-vf", "select=not(between(n\\,2\\,4))", "-fps_mode", "passthrough",
        *("-c:v", "ffv1"),
    )  # fmt: skip
    _, played, _ = play(path)
    assert [one.sequence for one in played] == [0, 1, 2, 3, *range(10, 16)]


# --- damage ---


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("a.mkv", ("-c:v", "ffv1", "-level", "3", "-slicecrc", "1")),
        ("a.avi", ("-c:v", "mjpeg", "-pix_fmt", "yuvj420p", "-q:v", "2")),
        ("b.avi", ("-c:v", "dvvideo", "-pix_fmt", "yuv420p")),
        ("a.mp4", ("-c:v", "libx264", "-pix_fmt", "yuv420p", "-g", "1", "-qp", "10")),
        ("a.mpg", ("-c:v", "mpeg2video", "-pix_fmt", "yuv420p", "-g", "1", "-q:v", "2")),
    ],
)
def test_a_damaged_picture_ends_the_video_and_what_came_before_it_is_kept(tmp_path, name, options):
    path = by_ffmpeg(tmp_path / name, SMOOTH, *options)
    _, whole, _ = play(path)
    _, played, error = play(spoil(path, 0.6))
    assert isinstance(error, PictureError)
    assert f"{name}: the picture at " in error.message
    assert "is damaged (" in error.message
    assert "what came before it is kept" in error.hint
    assert 4 <= len(played) <= 10
    for one, other in zip(whole, played, strict=False):
        np.testing.assert_array_equal(one.field.luma, other.field.luma)


def test_without_ffmpeg_it_is_said_that_damage_goes_unnoticed(tmp_path, monkeypatch):
    path = coded(tmp_path / "a.avi", "MJPG", SMOOTH)
    monkeypatch.setenv("PATH", "")
    info, played, _ = play(path)
    assert len(played) == 16
    assert any("Damaged pictures" in one and "apt-get install ffmpeg" in one for one in info.remarks)


def test_without_ffmpeg_an_interlaced_video_is_refused_with_what_to_install(tmp_path, monkeypatch):
    path = interlaced(tmp_path / "ffv1.mkv")
    monkeypatch.setenv("PATH", "")
    with pytest.raises(DeviceRefused, match="cannot read an interlaced video") as caught:
        ReplayGrabber(path).open()
    assert "install FFmpeg: sudo apt-get install ffmpeg" in caught.value.hint


@pytest.mark.parametrize("name", ["ffv1.mkv", "mpeg2.ts", "dv.avi"])
def test_a_truncated_video_is_played_as_far_as_it_goes(tmp_path, name):
    path = interlaced(tmp_path / name)
    data = path.read_bytes()
    path.write_bytes(data[: int(0.6 * len(data))])
    _, played, error = play(path)
    assert isinstance(error, PictureError)
    assert 2 <= len(played) <= 10


def test_pictures_that_change_their_size_end_the_video(tmp_path):
    sizes = [128, 128, 128, 160, 160]
    pictures = [cv2.imencode(".jpg", luma(n, 100, columns))[1].tobytes() for n, columns in enumerate(sizes)]
    _, played, error = play(uncompressed(tmp_path / "a.avi", pictures, b"MJPG", 100, 128))
    assert isinstance(error, PictureError)
    assert (
        "a.avi: the picture at 0.120 s has 160x100 pixels, expected 128x100 like the first" in error.message
    )
    assert "what came before it is kept" in error.hint
    assert len(played) == 3


# --- the process ---


def test_the_process_ends_with_the_recording_and_holds_one_picture_at_a_time(tmp_path):
    path = interlaced(tmp_path / "ffv1.mkv", [luma(n) for n in range(40)])
    before = _children()
    grabber = ReplayGrabber(path)
    grabber.open()
    for _ in range(3):
        with grabber.dequeue(0) as fields:
            assert len(fields) == 2
    del fields
    (running,) = _children() - before
    grabber.close()
    assert running not in _children()


def test_the_process_has_ended_when_the_video_has(tmp_path):
    before = _children()
    play(interlaced(tmp_path / "ffv1.mkv"))
    assert _children() == before


def _children() -> set[str]:
    found: set[str] = set()
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            found.update((task / "children").read_text().split())
    return found
