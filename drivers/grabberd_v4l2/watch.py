"""Signal and standard of a streaming card, polled about once a second."""

from grabberd.instrument.acquisition.device import Signal
from grabberd_v4l2 import abi, standards
from grabberd_v4l2.node import Node
from grabberd_v4l2.profiles import SignalSource
from grabberd_v4l2.standards import Scan

_NO_SIGNAL = abi.IN_ST_NO_POWER | abi.IN_ST_NO_SIGNAL | abi.IN_ST_NO_H_LOCK
# Time for a decoder to lock.
_RECHECK_NS = 250_000_000


class Watch:
    """Queries signal and standard, if the card is known to report them.

    A wrong standard must be seen twice, since decoders guess while they lock. A camera without a standard
    cannot have a wrong one.

    Args:
        node: The streaming node.
        source: Query that reports a missing camera.
        scan: Scan of the granted standard.

    Attributes:
        trouble: Reason why the stream has become unusable, or None; `remedy`: what to do about it.
        tells: True if the card reported a signal status when last queried.
    """

    def __init__(self, node: Node, source: SignalSource, scan: Scan) -> None:
        self._node = node
        self._source = source
        self._scan = scan
        self._suspect_ns: int | None = None
        self.trouble: str | None = None
        self.remedy = ""
        self.tells = False

    def look(self) -> Signal:
        """Signal status; unknown if the card does not report one."""
        signal = self._signal()
        trouble = (
            None if self._scan.is_progressive else self._changed_by_others() or self._wrong_camera(signal)
        )
        self.tells = signal is not Signal.UNKNOWN
        if trouble is None:
            self._suspect_ns = None
        elif self._suspect_ns is None:
            self._suspect_ns = self._node.now_ns()
        elif self._node.now_ns() - self._suspect_ns >= _RECHECK_NS:
            self.trouble, self.remedy = trouble
        return signal

    def look_again(self) -> None:
        """Queries again only while a wrong standard waits to be confirmed, so it may be called often."""
        if self._suspect_ns is not None and self._node.now_ns() - self._suspect_ns >= _RECHECK_NS:
            self.look()

    def settle(self) -> str | None:
        """Waits a moment for the decoder to lock; returns the problem if it still sees a wrong standard."""
        self.look()
        while self._suspect_ns is not None and self.trouble is None:
            self._node.pause(_RECHECK_NS / 5e9)
            self.look()
        return self.trouble

    def _signal(self) -> Signal:
        # Polled, since hardly any analog card reports a change of its source (SOURCE_CHANGE).
        try:
            if self._source is SignalSource.ENUMINPUT:
                return _present(not self._node.input().status & _NO_SIGNAL)
            if self._source is SignalSource.QUERYSTD:
                return _present(self._node.seen_standard() != 0)
        except OSError:
            pass
        return Signal.UNKNOWN

    def _changed_by_others(self) -> tuple[str, str] | None:
        try:
            standard = self._node.standard()
        except OSError:
            return None
        if standards.scan(standard) == self._scan:
            return None
        said = f"another program has set the card to {standards.name(standard)}"
        return said, f"grabberd restarts it at {self._scan}; end that program"

    def _wrong_camera(self, signal: Signal) -> tuple[str, str] | None:
        """A problem with the camera's standard, and its remedy; without a signal, many cards guess 60 Hz."""
        if signal is not Signal.PRESENT:
            return None
        try:
            seen = standards.scan(self._node.seen_standard())
        except OSError:
            return None
        if seen is None or seen == self._scan:
            return None
        own, other = standards.family(self._scan), standards.family(seen)
        return (
            f"the camera's signal is of {seen} ({other}), but the card is set to {self._scan} ({own})",
            f"connect a {own} camera, and grabberd resumes; or set the option 'standard: {other}', "
            f"and the rig's lines to {seen.lines}",
        )


def _present(there: bool) -> Signal:
    return Signal.PRESENT if there else Signal.ABSENT
