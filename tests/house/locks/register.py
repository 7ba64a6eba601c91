"""All locks, by name: what each looks at, and what it leaves out on a computer of another kind."""

from collections.abc import Callable
from typing import Any, NamedTuple

from . import captures, exits, exports, interface, messages, names, points, restored
from .computer import KIND, PACKAGES
from .differences import differences
from .kept import plain, read, write

Document = dict[str, Any]


class Lock(NamedTuple):
    """A lock.

    Attributes:
        made: Looks at this program.
        reduced: By a key of the document: what is left to compare where that key's values differ.
        relative: Share by which numbers may differ then.
        always: True if that is so on every computer, since caches decide in which order linear algebra sums.
        grows: True if there may be more than was kept.
        kept: Makes what is kept, where that is less than what is looked at.
    """

    made: Callable[[], Document]
    reduced: dict[str, Callable[[Any], Any]] = {}  # noqa: RUF012 - never changed
    relative: float = 0.0
    always: bool = False
    grows: bool = False
    kept: Callable[[], Document] | None = None

    def compared(self, name: str) -> list[str]:
        """Differences between this program and what was kept, a line each."""
        kept, now = read(name), plain(self.made())
        relative = 0.0
        for key, reduced in self.reduced.items():
            if self.always or kept[key] != now[key]:
                kept, now, relative = reduced(kept), reduced(now), self.relative
        found = differences(kept, now, relative)
        return [one for one in found if not (self.grows and ": is new (" in one)]


_BITS = {KIND: points.without_bits}
_PACKED = {PACKAGES: exports.without_packed}
_BLOBS = {PACKAGES: captures.without_blobs}
LOCKS = {
    "http": Lock(interface.http),
    "help": Lock(interface.help_texts),
    "schemas": Lock(interface.schemas),
    "errors": Lock(names.errors),
    "metrics": Lock(names.metrics),
    "entry_points": Lock(names.entry_points),
    "extras": Lock(names.extras),
    "imports": Lock(names.importable, grows=True, kept=names.imports),
    "mqtt": Lock(messages.mqtt),
    "lsl": Lock(messages.lsl),
    "captures": Lock(captures.read),
    "captures_written": Lock(captures.written, _BLOBS),
    "captures_converted": Lock(captures.converted, _BLOBS),
    "exports": Lock(exports.points_files, _PACKED),
    "exports_analysis": Lock(exports.analysis_files, _BITS),
    "pictures": Lock(exports.pictures, _BITS),
    "points": Lock(points.points, _BITS, points.RELATIVE),
    "computed": Lock(points.computed, _BITS, points.RELATIVE, always=True),
    "calibration": Lock(points.calibration, _BITS, points.RELATIVE, always=True),
    "exits": Lock(exits.exits, _BITS),
    "state": Lock(restored.state),
}


def keep(name: str) -> None:
    """Keeps what this program says, in place of what was kept."""
    lock = LOCKS[name]
    write(name, plain((lock.kept or lock.made)()))
