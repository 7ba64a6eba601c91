"""The threshold in force: chosen beside the capture thread, held during a capture."""

import logging
import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.config import DeviceConfig
from grabberd.errors import MeasurementError
from grabberd.field import Field
from grabberd.measurement import ThresholdRule
from grabberd.processes.thresholds import field_threshold, field_threshold_map
from grabberd.service.device.configured_ring import ConfiguredRing
from grabberd.service.device.newest_field import NewestField

log = logging.getLogger(__name__)

EVERY_S = 1.0
FIELD_WITHIN_S = 0.25
PACKED_WITHIN_S = 0.1
"""A field comes every 20 ms, unless there is none."""
SETTLED_WITHIN_S = 2.0
"""Far more than the next field and the first choice for it take."""
UNDECIDED_THRESHOLD = 128
"""In force while the picture has no contrast to choose by."""


class Threshold(NamedTuple):
    """A grey value for all pixels, or one for each; then `level` is their median."""

    level: int
    by_pixel: NDArray[np.uint8] | None = None

    def of(self, field: Field, bits: int) -> int | NDArray[np.uint8]:
        """What such a field is quantised with: by pixel at 1 bit, unless it is of other lines."""
        if self.by_pixel is None or bits != 1 or self.by_pixel.shape != field.luma.shape:
            return self.level
        return self.by_pixel


class ThresholdKeeper:
    """Looks at a copy of the newest field about once a second and chooses by it, in a thread of its own.

    A recording's first field, and the first of every capture of it, is chosen by before it is packed, so that
    the same recording gives the same threshold each time.

    Attributes:
        in_force: what the next field is quantised with.
    """

    def __init__(self, config: DeviceConfig) -> None:
        self._rule = _rule(config)
        self._by_pixel = config.threshold.map
        self.in_force = Threshold(UNDECIDED_THRESHOLD if self._rule.value is None else self._rule.value)
        self._newest = NewestField()
        self._deciding = threading.Condition()
        self._live = True
        self._held = False
        self._looked_for: ConfiguredRing | None = None
        self._chosen_for: ConfiguredRing | None = None
        self._at_once = threading.Event()
        self._packing_next = threading.Event()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def _fixed(self) -> bool:
        return self._rule.kind == "fixed"

    def start(self, name: str) -> None:
        """Begins to look."""
        self._thread = threading.Thread(target=self._run, name=f"threshold-{name}", daemon=True)
        self._thread.start()

    def use(self, config: DeviceConfig) -> None:
        """Chooses by another rule from the next look on; not during a capture."""
        with self._deciding:
            self._rule, self._by_pixel = _rule(config), config.threshold.map
            self._looked_for = self._chosen_for = None
            if self._rule.value is not None:
                self.in_force = Threshold(self._rule.value)

    def stop(self, timeout_s: float) -> None:
        """Ends the looking."""
        self._stopping.set()
        self._at_once.set()
        if self._thread is not None:
            self._thread.join(timeout_s)

    def opened(self, *, live: bool) -> None:
        """The capture thread has opened a live device, or a recording."""
        self._live = live

    def show(self, field: Field, armed: ConfiguredRing) -> None:
        """The capture thread has a field for this ring and is about to pack it."""
        if self._fixed:
            return
        self._packing_next.set()
        if self._live or not self._held:
            self._newest.offer(field, armed)
        if not self._live and self._chosen_for is not armed:
            self._look(field, armed)

    def settle(self, armed: ConfiguredRing) -> None:
        """Waits until a live device's picture has been looked at for this ring; not for long."""
        if self._fixed or not self._live:
            return
        self._at_once.set()
        with self._deciding:
            self._deciding.wait_for(lambda: self._looked_for is armed, SETTLED_WITHIN_S)
        self._at_once.clear()

    def hold(self) -> None:
        """A capture begins: what has been chosen for its ring stays; a recording is chosen for once more.

        The field that a live device's thread is packing may have the threshold of before: it is waited for.
        """
        with self._deciding:
            self._held = True
            if not self._live:
                self._chosen_for = None
        if self._live and not self._fixed:
            self._packing_next.clear()
            self._packing_next.wait(PACKED_WITHIN_S)

    def release(self) -> None:
        """The capture is over."""
        self._held = False

    def look_again(self) -> None:
        """Asks for the newest field and chooses by it, unless the threshold is held or fixed."""
        if self._fixed:
            return
        shown = self._newest.ask(FIELD_WITHIN_S)
        if shown is not None and self._free(shown.armed):
            self._look(shown.field, shown.armed, beside=True)

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self.look_again()
            except Exception:
                log.exception("choosing a threshold failed; the one in force stays")
                self._stopping.wait(EVERY_S)
            self._at_once.wait(EVERY_S if self._looked_for or self._fixed else 0)

    def _free(self, armed: ConfiguredRing) -> bool:
        """Whether this thread may choose: a held one only if it has not been chosen yet."""
        return not self._held or (self._live and self._chosen_for is not armed)

    def _look(self, field: Field, armed: ConfiguredRing, *, beside: bool = False) -> None:
        rule = self._rule
        try:
            chosen = self._choose(field, armed)
        except MeasurementError:
            chosen = None  # nothing to choose by, e.g. a dark picture: the one in force stays
        with self._deciding:
            if rule is not self._rule:
                return  # another one is in force by now
            if chosen and (not beside or self._free(armed)):
                self.in_force, self._chosen_for = chosen, armed
            self._looked_for = armed
            self._deciding.notify_all()

    def _choose(self, field: Field, armed: ConfiguredRing) -> Threshold:
        doubled = armed.lines == "doubled"
        if not (self._by_pixel and armed.bits == 1):
            return Threshold(field_threshold(field, self._rule, armed.bits, doubled=doubled))
        by_pixel = field_threshold_map(field, self._rule, doubled=doubled)
        return Threshold(int(np.median(by_pixel)), by_pixel)


def _rule(config: DeviceConfig) -> ThresholdRule:
    return ThresholdRule(
        config.threshold.kind,
        config.threshold.value,
        spread_px=config.spread_px,
        line_jitter_px=config.line_jitter_px,
    )
