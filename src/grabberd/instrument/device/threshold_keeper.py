"""The threshold in force: chosen outside the capture thread, held during a capture (docs/decisions).

It is chosen by a copy of the newest 8-bit field, which is made on request, so it costs the capture thread
nothing otherwise.
"""

import logging
import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd import runtime
from grabberd.config import DeviceConfig
from grabberd.core.chain.light import field_threshold, field_threshold_map
from grabberd.core.field import Field, map_level
from grabberd.core.measurement import ThresholdRule
from grabberd.errors import MeasurementError
from grabberd.instrument.acquisition import Ring

SHARED_S = 0.2
"""Time for which a copy is shared: five copies per second at most, for any number of requests."""
log = logging.getLogger(__name__)
EVERY_S = 1.0
"""Pause between two choices: fast enough for a barn's light, and a choice takes up to a tenth of a second."""
FIELD_WITHIN_S = 0.25
PACKED_WITHIN_S = 0.1
"""Longest waits for a field: it comes far sooner, unless there is none."""
SETTLED_WITHIN_S = 2.0
"""Longest wait for a choice; far more than the next field and the first choice for it take."""
UNDECIDED_THRESHOLD = 128
"""Threshold while the contrast is too low for choosing one."""


class Shown(NamedTuple):
    """A copied field.

    Attributes:
        field: The field in separate memory, with its original lines.
        ring: The ring of the field.
        time_ns: Middle of its exposure by the driver; 0 if it is not needed.
    """

    field: Field
    ring: Ring
    time_ns: int = 0


class NewestField:
    """Passes the newest field on request to other threads; the capture thread offers every field."""

    def __init__(self, now_s: Callable[[], float] = runtime.monotonic) -> None:
        self._now_s = now_s
        self._given = runtime.condition()
        self._wanted = False
        self._count = 0
        self._shown: Shown | None = None
        self._shown_s = -math.inf

    def offer(self, field: Field, ring: Ring, time_ns: int = 0) -> None:
        """Provides a copy if one is requested."""
        # Read without the lock: the capture thread offers every field, and most are not requested.
        if not self._wanted:
            return
        # The field is a view into the driver's buffer, which is requeued when the capture thread continues.
        copy = Shown(replace(field, luma=np.array(field.luma)), ring, time_ns)
        with self._given:
            self._shown, self._shown_s, self._wanted = copy, self._now_s(), False
            self._count += 1
            self._given.notify_all()

    def ask(self, timeout_s: float) -> Shown | None:
        """The next offered field, or None if none comes in time."""
        with self._given:
            before, self._wanted = self._count, True
            self._given.wait_for(lambda: self._count > before, timeout_s)
            return self._shown if self._count > before else None

    def recent(self, timeout_s: float) -> Shown | None:
        """The last copy if it is younger than `SHARED_S`, else the next field."""
        with self._given:
            if self._shown is not None and self._now_s() - self._shown_s < SHARED_S:
                return self._shown
        return self.ask(timeout_s)


class Threshold(NamedTuple):
    """A threshold for all pixels, or one for each.

    Attributes:
        level: Grey value for all pixels; the median if there is one for each.
        by_pixel: (rows, columns) uint8, a grey value for each pixel, or None.
    """

    level: int
    by_pixel: NDArray[np.uint8] | None = None


class ThresholdKeeper:
    """Chooses a threshold about once a second by a copy of the newest field, in a separate thread.

    For a replayed recording it is chosen by the first field, and by the first of every capture, before that
    is packed, so that the same recording always has the same threshold.

    Attributes:
        in_force: Threshold that the next field is quantised with.
        held: True while a capture keeps the threshold constant.
    """

    def __init__(self, config: DeviceConfig) -> None:
        self._rule = _rule(config)
        self._by_pixel = config.threshold.map
        self.in_force = Threshold(UNDECIDED_THRESHOLD if self._rule.value is None else self._rule.value)
        self._newest = NewestField()
        self._deciding = runtime.condition()
        self._live = True
        self.held = False
        self._tried_for: Ring | None = None
        self._chosen_for: Ring | None = None
        self._at_once = runtime.event()
        self._packing_next = runtime.event()
        self._stopping = runtime.event()
        self._thread: runtime.Thread | None = None

    @property
    def _fixed(self) -> bool:
        return self._rule.kind == "fixed"

    def start(self, name: str) -> None:
        """Starts the thread."""
        self._thread = runtime.Thread(target=self._run, name=f"threshold-{name}", daemon=True)
        self._thread.start()

    def use(self, config: DeviceConfig) -> None:
        """Sets the rule from the next choice on; not during a capture."""
        with self._deciding:
            self._rule, self._by_pixel = _rule(config), config.threshold.map
            self._tried_for = self._chosen_for = None
            if self._rule.value is not None:
                self.in_force = Threshold(self._rule.value)

    def stop(self, timeout_s: float) -> None:
        """Ends the thread."""
        self._stopping.set()
        self._at_once.set()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def opened(self, *, live: bool) -> None:
        """Notes that the capture thread has opened a live device, or a recording."""
        self._live = live

    def for_next_field(self) -> Threshold:
        """The threshold for the field that the capture thread packs next."""
        self._packing_next.set()
        return self.in_force

    def show(self, field: Field, ring: Ring) -> None:
        """Submits a field with a picture; a recording's before it is packed for this ring."""
        if self._fixed:
            return
        if self._live or not self.held:
            self._newest.offer(field, ring)
        if not self._live and self._chosen_for is not ring:
            self._try(field, ring)

    def settle(self, ring: Ring) -> None:
        """Waits for a limited time until a choice has been tried for this ring on a live device's picture."""
        if self._fixed or not self._live:
            return
        self._at_once.set()
        with self._deciding:
            self._deciding.wait_for(lambda: self._tried_for is ring, SETTLED_WITHIN_S)
        self._at_once.clear()

    def hold(self) -> None:
        """Holds the threshold for a starting capture; for a recording it is chosen once more."""
        with self._deciding:
            self.held = True
            if not self._live:
                self._chosen_for = None
        if self._live and not self._fixed:
            # The field being packed now may have the previous threshold: wait for the next.
            self._packing_next.clear()
            self._packing_next.wait(PACKED_WITHIN_S)

    def release(self) -> None:
        """Lets the threshold follow the light again, after a capture or a failed start."""
        self.held = False

    def choose_again(self) -> None:
        """Requests the newest field and chooses by it, unless the threshold is held or fixed."""
        if self._fixed:
            return
        shown = self._newest.ask(FIELD_WITHIN_S)
        if shown is not None and self._may_choose(shown.ring):
            self._try(shown.field, shown.ring, beside=True)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self.choose_again()
            except Exception:
                log.exception("choosing a threshold failed; the one in force stays")
                self._stopping.wait(EVERY_S)
            # No pause before the first choice, for which the first capture waits.
            self._at_once.wait(EVERY_S if self._tried_for or self._fixed else 0)

    def _may_choose(self, ring: Ring) -> bool:
        """True if this thread may choose: if held, only if none has been chosen for the ring yet."""
        return not self.held or (self._live and self._chosen_for is not ring)

    def _try(self, field: Field, ring: Ring, *, beside: bool = False) -> None:
        """Chooses by a field; `beside`: in the keeper's thread, during which a capture may start."""
        rule = self._rule
        try:
            chosen = self._choose(field, ring)
        except MeasurementError:
            chosen = None  # no contrast, e.g. a dark picture: the one in force stays
        with self._deciding:
            if rule is not self._rule:
                return  # another one has come into force
            if chosen and (not beside or self._may_choose(ring)):
                self.in_force, self._chosen_for = chosen, ring
            self._tried_for = ring
            self._deciding.notify_all()

    def _choose(self, field: Field, ring: Ring) -> Threshold:
        doubled = ring.lines == "doubled"
        if not (self._by_pixel and ring.bits == 1):
            return Threshold(field_threshold(field, self._rule, ring.bits, doubled=doubled))
        by_pixel = field_threshold_map(field, self._rule, doubled=doubled)
        return Threshold(map_level(by_pixel), by_pixel)


def _rule(config: DeviceConfig) -> ThresholdRule:
    return ThresholdRule(
        config.threshold.kind,
        config.threshold.value,
        spread_px=config.spread_px,
        line_jitter_px=config.line_jitter_px,
    )
