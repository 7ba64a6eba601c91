"""Video files for the tests of the replay driver."""

import shutil
import struct
import subprocess

import cv2
import numpy as np
import pytest

from drivers.replay.pictures import COLUMNS, LINES, luma

COUNT = 3
needs_ffmpeg = pytest.mark.skipif(
    not (shutil.which("ffmpeg") and shutil.which("ffprobe")),
    reason="FFmpeg is missing: sudo apt-get install ffmpeg",
)


def _chunk(name, data):
    return name + struct.pack("<I", len(data)) + data + bytes(len(data) % 2)


def _list(name, *chunks):
    return _chunk(b"LIST", name + b"".join(chunks))


def uncompressed(path, pictures, fourcc, lines, columns, rate=(25, 1)):
    """An AVI of these pictures' bytes as they are; an empty one stands for a picture that was dropped."""
    size, count, bits = max(map(len, pictures), default=0), len(pictures), 8 if fourcc == b"Y800" else 16
    head = struct.pack("<14I", 40_000, 0, 0, 16, count, 0, 1, size, columns, lines, 0, 0, 0, 0)
    stream = (b"vids", fourcc, 0, 0, 0, rate[1], rate[0], 0, count, size, 0xFFFFFFFF, 0, 0, 0, columns, lines)
    form = struct.pack("<IiiHH4sIiiII", 40, columns, lines, 1, bits, fourcc, size, 0, 0, 0, 0)
    stream_list = _list(b"strl", _chunk(b"strh", struct.pack("<4s4s10I4h", *stream)), _chunk(b"strf", form))
    chunks = [_chunk(b"00dc", picture) for picture in pictures]
    places = np.cumsum([4, *map(len, chunks)])[:-1]
    index = b"".join(
        struct.pack("<4sIII", b"00dc", 16, place, len(picture))
        for place, picture in zip(places, pictures, strict=True)
    )
    body = _list(b"hdrl", _chunk(b"avih", head), stream_list) + _list(b"movi", *chunks)
    path.write_bytes(_chunk(b"RIFF", b"AVI " + body + _chunk(b"idx1", index)))
    return path


def avi(path, count=COUNT, lines=LINES, columns=COLUMNS, rate=(25, 1)):
    """Grey pictures, uncompressed."""
    pictures = [luma(n, lines, columns).tobytes() for n in range(count)]
    return uncompressed(path, pictures, b"Y800", lines, columns, rate)


def packed(path, fourcc, count=COUNT, lines=LINES, columns=COLUMNS):
    """Pictures with colours between the grey values: UYVY or YUY2."""
    grey_and_colour = [(luma(n, lines, columns), luma(100 + n, lines, columns)) for n in range(count)]
    order = -1 if fourcc == b"UYVY" else 1
    pictures = [np.stack(pair[::order], axis=-1).tobytes() for pair in grey_and_colour]
    return uncompressed(path, pictures, fourcc, lines, columns)


def y4m(path, count=COUNT, lines=LINES, columns=COLUMNS):
    """Frames that are marked as interlaced, the top field first, with colours beside the grey values."""
    colours = bytes([128]) * (lines * columns // 2)
    frames = (b"FRAME\n" + luma(n, lines, columns).tobytes() + colours for n in range(count))
    path.write_bytes(b"YUV4MPEG2 W%d H%d F25:1 It A1:1 C420jpeg\n" % (columns, lines) + b"".join(frames))
    return path


def coded(path, fourcc, pictures, rate_hz=25.0):
    """Pictures by a codec of OpenCV's: FFV1 and MPNG without loss, MJPG with."""
    lines, columns = pictures[0].shape
    code, size = cv2.VideoWriter.fourcc(*fourcc), (columns, lines)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, code, rate_hz, size, isColor=False)
    for picture in pictures:
        writer.write(picture)
    writer.release()
    return path


def by_ffmpeg(path, pictures, *options, rate="25"):
    """Pictures of 8 bits, written by the program `ffmpeg` with these options."""
    lines, columns = pictures[0].shape[:2]
    form = "gray" if pictures[0].ndim == 2 else "bgr24"
    source = ["-f", "rawvideo", "-pix_fmt", form, "-s", f"{columns}x{lines}", "-r", rate, "-i", "-"]
    content = b"".join(one.tobytes() for one in pictures)
    subprocess.run(["ffmpeg", "-v", "error", "-y", *source, *options, path], input=content, check=True)
    return path


def spoil(path, part, count=60):
    """Zeroes some bytes of a file, so many after the beginning as this part of it is long."""
    data = bytearray(path.read_bytes())
    at = int(part * len(data))
    data[at : at + count] = bytes(count)
    path.write_bytes(data)
    return path
