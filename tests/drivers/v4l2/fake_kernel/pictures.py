"""The camera's fields, or whole pictures, and how a card lays them into memory."""

import cv2
import numpy as np

from grabberd_v4l2.abi import Arrangement

ROWS = 288
CHROMA = 77
STACKED = {Arrangement.SEQ_TB: 0, Arrangement.SEQ_BT: 1}
SINGLE = (Arrangement.TOP, Arrangement.BOTTOM, Arrangement.ALTERNATE)


def field_picture(number, columns=720, rows=ROWS):
    """(rows, columns) of the camera's field of that number; its parity is that of the number."""
    picture = _gradient(17 * number + 3 * (number % 2), columns, rows, 6)
    picture[:, :4] = np.frombuffer(number.to_bytes(4, "big"), np.uint8)
    picture[:, 4] = number % 2
    return picture


def whole_picture(number, columns, lines):
    """(lines, columns) of a progressive camera's picture of that number."""
    picture = _gradient(17 * number, columns, lines, 3)
    picture[:, :4] = np.frombuffer(number.to_bytes(4, "big"), np.uint8)
    return picture


def _gradient(first, columns, lines, a_line):
    """(lines, columns) of grey values that grow by one a column, and begin again after 255."""
    down = (first + a_line * np.arange(lines)).astype(np.uint8)
    return down[:, None] + np.arange(columns).astype(np.uint8)


def blocks_picture(number, columns, lines):
    """The same for a camera that compresses: its number in blocks of 8×8, a gradient below them."""
    picture = np.empty((lines, columns), np.uint8)
    picture[:] = (np.arange(columns) * 200 // columns + 20 + number % 7).astype(np.uint8)
    bits = np.array([number >> k & 1 for k in range(32)], np.uint8)
    picture[:8, :256] = np.repeat(bits * 255, 8)
    return picture


def number_in_blocks(luma):
    """The number of the picture that was compressed."""
    bits = luma[:8, :256].reshape(8, 32, 8).mean(axis=(0, 2)) > 128
    return sum(int(bit) << k for k, bit in enumerate(bits))


def jpeg(picture):
    """(n,) bytes as a camera sends them, with colour that says nothing."""
    coloured = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    _, data = cv2.imencode(".jpg", coloured, [cv2.IMWRITE_JPEG_QUALITY, 90])
    return data.ravel()


def number_in(luma):
    """The number of the field that a picture is of."""
    return int.from_bytes(bytes(luma[0, :4]), "big")


def arranged(numbers, arrangement, columns, rows=ROWS):
    """(lines, columns) of a buffer that holds these fields."""
    if arrangement in SINGLE:
        return field_picture(numbers[0], columns, rows)
    frame = np.empty((2 * rows, columns), np.uint8)
    for number in numbers:
        parity = number % 2
        if arrangement in STACKED:
            first = rows * (parity != STACKED[arrangement])
            frame[first : first + rows] = field_picture(number, columns, rows)
        else:
            frame[parity::2] = field_picture(number, columns, rows)
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
