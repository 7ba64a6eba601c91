"""The simulated camera's pictures, each drawn once a process and shown again every second of its clock.

Drawing takes most of a field's time, and where a whole service is the subject, the pictures are not. The
liner moves once a second, so its truth holds for every copy; the stamp of field and parity is written anew.
"""

import threading
from dataclasses import replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd_fake.faults import Knock
from grabberd_fake.optics import COLUMNS
from grabberd_fake.options import DriverOptions, FakeOptions
from grabberd_fake.render import ROWS
from grabberd_fake.stamp import Stamp, write_stamp
from grabberd_fake.world import World

CYCLE_FIELDS = 50
"""A cycle of the liner; even, so that a field keeps its parity."""
LIFTS = 16
"""Each cycle is a grey value brighter than the one before, so many times: rows that come again bit
for bit would be taken for stale.
"""
FILMS = 4
"""Kept at a time; each takes 10 MB."""


class Film:
    """Fields of one scene, drawn as they are asked for; by several devices, if they show the same."""

    def __init__(self, options: FakeOptions) -> None:
        self.world = World(options)
        self._drawn: dict[int, NDArray[np.uint8]] = {}
        self._drawing = threading.Lock()

    def field(self, number: int) -> NDArray[np.uint8]:
        """(288, 720) luma of a field of the cycle."""
        with self._drawing:
            if number not in self._drawn:
                luma = np.empty((ROWS, COLUMNS), np.uint8)
                self.world.picture(number, luma)
                self._drawn[number] = luma
            return self._drawn[number]


_film = lru_cache(maxsize=FILMS)(Film)


class RecordedWorld:
    """Stands in for the simulated grabber's world."""

    waited_ns = 0

    def __init__(self, options: FakeOptions) -> None:
        self._stamp, self._seed = options.picture.stamp, options.seed
        # Whatever changes no picture is left out, so that devices share a film whatever befalls them.
        self._film = _film(
            replace(options, pace="real", buffers=2, driver=DriverOptions(), faults=(), cue=None, seed=0)
        )

    def picture(self, field: int, out: NDArray[np.uint8]) -> None:
        """Writes the luma of the camera's field into `out` (288, 720)."""
        cycle, number = divmod(field, CYCLE_FIELDS)
        cv2.add(self._film.field(number), float(cycle % LIFTS), dst=out)
        if self._stamp:
            write_stamp(out, Stamp(field, field % 2))

    def random(self, field: int) -> np.random.Generator:
        """The random numbers of a field."""
        return np.random.Generator(np.random.SFC64([self._seed, field]))


def world_of(options: FakeOptions) -> World | RecordedWorld:
    """A recorded world, unless the scene's period, its gain, its lamp or a knock would tell copies apart."""
    if any(isinstance(fault, Knock) for fault in options.faults):
        return World(options)
    repeats = options.liner.period_s == options.ellipse.period_s == 1.0 and options.picture.agc_level is None
    return RecordedWorld(options) if repeats and not options.light.diameter_px else World(options)
