"""A copy of the newest 8-bit field for who asks, at no cost to the capture thread while nobody does."""

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


class Shown(NamedTuple):
    """A field of its own memory, its lines as they came, and the ring that it went into."""

    field: Field
    armed: ConfiguredRing


class NewestField:
    """Between the capture thread, which offers every field, and those who ask."""

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._given = threading.Condition()
        self._wanted = False
        self._count = 0
        self._shown: Shown | None = None
        self._shown_s = -math.inf

    def offer(self, field: Field, armed: ConfiguredRing) -> None:
        """Leaves a copy if one is asked for."""
        if not self._wanted:
            return
        copy = Shown(replace(field, luma=np.array(field.luma)), armed)
        with self._given:
            self._shown, self._shown_s, self._wanted = copy, self._now_s(), False
            self._count += 1
            self._given.notify_all()

    def ask(self, timeout_s: float) -> Shown | None:
        """The next field that is offered, or None if none is in time."""
        with self._given:
            before, self._wanted = self._count, True
            self._given.wait_for(lambda: self._count > before, timeout_s)
            return self._shown if self._count > before else None

    def recent(self, timeout_s: float) -> Shown | None:
        """The field that was shown last, if that was less than a fifth of a second ago; else the next.

        However many ask, no more than five copies a second are made.
        """
        with self._given:
            if self._shown is not None and self._now_s() - self._shown_s < EVERY_S:
                return self._shown
        return self.ask(timeout_s)
