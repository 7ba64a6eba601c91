"""A copy of the newest 8-bit field for who asks, at no cost to the capture thread while nobody does."""

import threading
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from grabberd.field import Field
from grabberd.service.armed import Armed


class Shown(NamedTuple):
    """A field of its own memory, its lines as they came, and the ring that it went into."""

    field: Field
    armed: Armed


class NewestField:
    """Between the capture thread, which offers every field, and one asker."""

    def __init__(self) -> None:
        self._given = threading.Condition()
        self._wanted = False
        self._shown: Shown | None = None

    def offer(self, field: Field, armed: Armed) -> None:
        """Leaves a copy if one is asked for."""
        if not self._wanted:
            return
        copy = Shown(replace(field, luma=np.array(field.luma)), armed)
        with self._given:
            self._shown, self._wanted = copy, False
            self._given.notify()

    def ask(self, timeout_s: float) -> Shown | None:
        """The next field that is offered, or None if none is in time."""
        with self._given:
            self._shown, self._wanted = None, True
            self._given.wait_for(lambda: self._shown is not None, timeout_s)
            return self._shown
