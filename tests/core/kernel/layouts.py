"""Where a field's rows may lie in a driver's buffer."""

import numpy as np


def packed_rows(luma):
    return luma.copy()


def longer_rows(luma):
    """Rows with a few bytes behind them, not aligned to anything."""
    rows, columns = luma.shape
    return _within(
        np.full(3 + rows * (columns + 5), 77, np.uint8)[3:].reshape(rows, columns + 5)[:, :columns], luma
    )


def one_parity(luma):
    rows, columns = luma.shape
    return _within(np.full((2 * rows, columns), 77, np.uint8)[1::2], luma)


def yuyv(luma):
    """The luma of YUYV, woven: every other byte of every other line."""
    rows, columns = luma.shape
    return _within(np.full((2 * rows, 2 * columns), 77, np.uint8)[::2, ::2], luma)


def uyvy(luma):
    """The luma of UYVY ends with the last byte of the buffer."""
    rows, columns = luma.shape
    return _within(np.full((2 * rows, 2 * columns), 77, np.uint8)[1::2, 1::2], luma)


def every_fourth_byte(luma):
    rows, columns = luma.shape
    return _within(np.full((rows, 4 * columns), 77, np.uint8)[:, 3::4], luma)


def backwards(luma):
    """Bottom up, as some formats for windows are, and right to left."""
    return luma[::-1, ::-1].copy()[::-1, ::-1]


LAYOUTS = (packed_rows, longer_rows, one_parity, yuyv, uyvy, every_fourth_byte, backwards)


def _within(view, luma):
    view[:] = luma
    return view
