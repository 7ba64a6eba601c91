"""Folders of pictures for the tests of the replay driver."""

import csv

import cv2
import numpy as np

LINES, COLUMNS = 576, 720
HEAD = ("n", "time_ns", "sequence", "parity", "y0", "y_step", "outcome", "file")


def luma(n, lines=LINES, columns=COLUMNS):
    return np.random.default_rng(n).integers(0, 256, (lines, columns), np.uint8)


def png(picture):
    return cv2.imencode(".png", picture, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes()


def frames(directory, count=3, lines=LINES, columns=COLUMNS, name="frame-{:04d}.png"):
    directory.mkdir(exist_ok=True)
    for n in range(count):
        (directory / name.format(n)).write_bytes(png(luma(n, lines, columns)))
    return directory


def manifest(directory, rows):
    with (directory / "fields.csv").open("w", newline="") as file:
        csv.writer(file).writerows([HEAD, *rows])
