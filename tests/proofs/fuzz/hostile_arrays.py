"""The compiled kernel under sanitisers, with sizes that do not match, odd widths and extreme numbers."""

import ctypes
import math
import sys
from contextlib import suppress
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

from core.kernel import sanitised
from grabberd.core.kernel import load
from grabberd.core.measurement.location import GreySettings, Settings

CALLS = 4000
EDGE = np.zeros((5120, 2), np.float32)
EXTREMES = (
    0,
    1,
    -1,
    2,
    7,
    8,
    9,
    63,
    64,
    65,
    255,
    1 << 24,
    1 << 28,
    1 << 31,
    1 << 32,
    (1 << 63) - 1,
    -(1 << 63),
)
REALS = (0.0, -0.0, 1.0, -1.0, 0.5, 7.0, 15.0, 1e3, 1e-300, 1e300, math.nan, math.inf, -math.inf)


def run(folder: Path, seed: int, calls: int = CALLS) -> tuple[int, str]:
    """Calls it in a process of its own; returns the exit code, 0 without sanitisers, and what it said."""
    if sanitised.runtime() is None:
        return 0, "no sanitisers here"
    sanitised.build(folder)
    done = sanitised.run(folder, Path(__file__), str(seed), str(calls))
    return done.returncode, done.stderr


def call(random: Random, kernel: Any) -> None:
    """One call of one function, which may refuse."""
    with suppress(ValueError, OverflowError):  # refused
        random.choice((_locate, _grey, _grey, _wall, _pack, _take, _take, _shifted))(random, kernel)


def _whole_number(random: Random, near: int) -> int:
    return random.choice((near, near, near, near, near + 1, near - 1, 2 * near, random.choice(EXTREMES)))


def _picture(random: Random, planes: int, wide: int) -> tuple[np.ndarray[Any, Any], int, int, int]:
    rows, columns = random.randint(1, 70), random.randint(1, 300)
    stride = -(-columns // wide)
    data = np.frombuffer(random.randbytes(planes * rows * stride), np.uint8).copy()
    if random.random() < 0.7:
        data[np.frombuffer(random.randbytes(len(data)), np.uint8) < random.choice((60, 128, 250))] = (
            random.choice((0, 255))
        )
    return data, rows, stride, columns


def _locate(random: Random, kernel: Any) -> None:
    data, rows, stride, columns = _picture(random, 1, 8)
    size = [rows, stride, columns, random.randrange(2), random.randrange(2), random.choice((1, 2))]
    if random.random() < 0.5:
        size[random.randrange(6)] = _whole_number(random, random.choice(size))
    real = random.choice(REALS), random.choice(REALS), random.choice(REALS)
    out = np.empty(9 * random.choice((0, 1, 200, 5000)) + random.choice((0, 3)))
    kernel.locate(data, tuple(size), Settings(*real), out)


def _grey(random: Random, kernel: Any) -> None:
    bits = random.choice((2, 3, 4, 5, 6, 8, 8))
    data, rows, stride, columns = _picture(random, 1 if bits == 8 else bits, 1 if bits == 8 else 8)
    size = [
        bits,
        rows,
        stride,
        columns,
        random.randrange(3),
        random.randrange(2),
        random.choice((1, 2)),
        random.randrange(256),
    ]
    if random.random() < 0.5:
        size[random.randrange(8)] = _whole_number(random, random.choice(size))
    edge = ctypes.c_void_p(EDGE.ctypes.data)
    real = [
        random.choice((0.0, 15.0)),
        random.choice((15.0, 1e3)),
        random.choice((0.0, 0.12)),
        0.8,
        random.choice((1.0, math.nan)),
    ]
    if random.random() < 0.3:
        real[random.randrange(5)] = random.choice(REALS)
    wanted = GreySettings(*real, random.randrange(2), random.randrange(2), edge, len(EDGE))
    kernel.locate_grey(data, tuple(size), wanted, np.empty(9 * random.choice((0, 1, 200, 5000))))


def _lines(random: Random) -> np.ndarray[Any, Any]:
    """Rows of bytes in any strides; sometimes they are none."""
    rows, columns, step = random.randint(1, 70), random.randint(1, 200), random.choice((1, 1, 2, 2, 3, 4))
    buffer = np.frombuffer(random.randbytes(2 * rows * step * columns), np.uint8)
    buffer = buffer & random.choice((1, 255, 255)) if random.random() < 0.5 else buffer
    lines = buffer.reshape(2 * rows, step * columns)[random.randrange(2) :: 2, random.randrange(step) :: step]
    lines = lines[:: random.choice((1, 1, -1)), :: random.choice((1, 1, -1))]
    return lines if random.random() < 0.95 else random.choice((lines[0], lines[None], lines.astype(np.int16)))


def _how(random: Random) -> list[int]:
    how = [
        random.choice((1, 1, 2, 3, 4, 5, 6, 8)),
        random.randrange(2),
        random.randrange(2),
        random.randrange(2),
    ]
    how.append(random.choice((-1, 0, 60, 254, 255, 256)))
    if random.random() < 0.2:
        how[random.randrange(5)] = random.choice(EXTREMES)
    return how


def _packed(random: Random, lines: np.ndarray[Any, Any], how: list[int]) -> tuple[bytes, bytearray]:
    """A threshold map, or none, and memory for the packed field; their lengths may be wrong."""
    rows, columns = lines.shape[-2:] if lines.ndim > 1 else (1, lines.shape[0])
    rows *= 1 + bool(how[1])
    planes, stride = (1, columns) if how[0] == 8 else (min(max(how[0], 0), 9), -(-columns // 8))
    by_pixel = random.randbytes(rows * columns) if how[0] == 1 and random.random() < 0.4 else b""
    return by_pixel, bytearray(_length(random, planes * rows * stride))


def _length(random: Random, right: int) -> int:
    return max(0, right + random.choice((0, 0, 0, 0, 0, 0, 1, -1)))


def _pack(random: Random, kernel: Any) -> None:
    lines, how = _lines(random), _how(random)
    kernel.pack(lines, tuple(how), *_packed(random, lines, how))


def _take(random: Random, kernel: Any) -> None:
    lines, how = _lines(random), _how(random)
    rows, columns = lines.shape[-2:] if lines.ndim > 1 else (1, lines.shape[0])
    words = -(-columns // 8)
    copy = np.zeros(_length(random, rows * words), np.uint64)
    good = np.zeros(random.choice((0, len(copy), rows * words)), np.uint64)
    size = 8 * _length(random, words + 74 * rows)
    memory = np.frombuffer(bytearray(random.choice((random.randbytes, bytes))(size)), np.uint64)
    means = np.zeros(_length(random, (rows // 12) * (columns // 4)), np.int16)
    place = random.choice((0, 63, 64, -1, random.randrange(64)))
    packed = _packed(random, lines, how)
    for _ in range(random.randint(1, 3)):
        kernel.take(lines, tuple(how), *packed, copy, good, memory, place, means)
        place = (place + 1) % 64


def _shifted(random: Random, kernel: Any) -> None:
    size = [random.randint(0, 30), random.randint(0, 200)]
    highest = random.choice((1, 255, 255, 255, 256, 1 << 15))
    now, then = (
        np.array([random.randrange(highest) for _ in range(_length(random, size[0] * size[1]))], np.int16)
        for _ in range(2)
    )
    if random.random() < 0.3:
        size[random.randrange(2)] = random.choice(EXTREMES)
    kernel.shifted(now, then, *size)


def _numbers(random: Random, count: int) -> np.ndarray[Any, Any]:
    return np.array([random.choice(REALS) for _ in range(max(0, count + random.choice((0, 0, 0, 0, 1, -1))))])


def _wall(random: Random, kernel: Any) -> None:
    n = random.randint(0, 5)
    values, rest, real = _numbers(random, 20 * n), _numbers(random, 7 * n), random.choice(REALS)
    if random.random() < 0.5:
        kernel.wall_forces(values, rest, real, _numbers(random, 24 * n), _numbers(random, 96 * n))
    else:
        kernel.wall_stiffness(
            values, rest, real, random.choice(REALS), _numbers(random, n), _numbers(random, 576 * n)
        )


if __name__ == "__main__":
    sanitised_kernel = load("_sanitised")
    assert sanitised_kernel
    source = Random(int(sys.argv[1]))
    for _ in range(int(sys.argv[2])):
        call(source, sanitised_kernel)
