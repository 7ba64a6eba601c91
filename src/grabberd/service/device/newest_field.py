"""A copy of the newest 8-bit field on request; costs the capture thread nothing while nobody asks."""

import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from grabberd.field import Field
from grabberd.service.device.configured_ring import ConfiguredRing

EVERY_S = 0.2
"""A copy is shared by all who ask within this time: five copies per second at most, however many look."""


class Shown(NamedTuple):
    """A copied field.

    Attributes:
        field: The field in memory of its own, with its lines as they came.
        ring: The ring that it went into.
    """

    field: Field
    ring: ConfiguredRing


class NewestField:
    """Hands the newest field from the capture thread, which offers every one, to those who ask."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._given = threading.Condition()
        self._wanted = False
        self._count = 0
        self._shown: Shown | None = None
        self._shown_s = -math.inf

    def offer(self, field: Field, ring: ConfiguredRing) -> None:
        """Leaves a copy if one is asked for."""
        # Read without the lock: the capture thread comes by 50 times a second and mostly nobody asks.
        if not self._wanted:
            return
        # The field is a view into the driver's buffer, which is requeued when the capture thread goes on.
        copy = Shown(replace(field, luma=np.array(field.luma)), ring)
        with self._given:
            self._shown, self._shown_s, self._wanted = copy, self._now_s(), False
            self._count += 1
            self._given.notify_all()

    def ask(self, timeout_s: float) -> Shown | None:
        """The next field that is offered, or None if none comes in time."""
        with self._given:
            before, self._wanted = self._count, True
            self._given.wait_for(lambda: self._count > before, timeout_s)
            return self._shown if self._count > before else None

    def recent(self, timeout_s: float) -> Shown | None:
        """The last copy if it is younger than `EVERY_S`, else the next field."""
        with self._given:
            if self._shown is not None and self._now_s() - self._shown_s < EVERY_S:
                return self._shown
        return self.ask(timeout_s)
