"""The camera's fields and how a card lays them into memory."""

import numpy as np

from grabberd_v4l2.abi import Arrangement

ROWS = 288
CHROMA = 77
STACKED = {Arrangement.SEQ_TB: 0, Arrangement.SEQ_BT: 1}
SINGLE = (Arrangement.TOP, Arrangement.BOTTOM, Arrangement.ALTERNATE)


def field_picture(number, columns=720):
    """(288, columns) of the camera's field of that number; its parity is that of the number."""
    lines = 2 * np.arange(ROWS) + number % 2
    picture = (17 * number + 3 * lines[:, None] + np.arange(columns)).astype(np.uint8)
    picture[:, :4] = np.frombuffer(number.to_bytes(4, "big"), np.uint8)
    picture[:, 4] = number % 2
    return picture


def number_in(luma):
    """The number of the field that a picture is of."""
    return int.from_bytes(bytes(luma[0, :4]), "big")


def arranged(numbers, arrangement, columns):
    """(lines, columns) of a buffer that holds these fields."""
    if arrangement in SINGLE:
        return field_picture(numbers[0], columns)
    frame = np.empty((2 * ROWS, columns), np.uint8)
    for number in numbers:
        parity = number % 2
        if arrangement in STACKED:
            first = ROWS * (parity != STACKED[arrangement])
            frame[first : first + ROWS] = field_picture(number, columns)
        else:
            frame[parity::2] = field_picture(number, columns)
    return frame


def bytes_per_line(fourcc, columns, padding=0):
    return columns * (2 if fourcc in ("YUYV", "UYVY") else 1) + padding


def size(fourcc, lines, stride):
    return lines * stride * 3 // 2 if fourcc == "NV12" else lines * stride


def encode(picture, fourcc, stride, memory):
    """Writes a picture (lines, columns) into a buffer's memory (bytes,)."""
    lines, columns = picture.shape
    memory[:] = CHROMA
    rows = memory[: lines * stride].reshape(lines, stride)
    if fourcc in ("YUYV", "UYVY"):
        rows[:, fourcc == "UYVY" : 2 * columns : 2] = picture
    else:
        rows[:, :columns] = picture
