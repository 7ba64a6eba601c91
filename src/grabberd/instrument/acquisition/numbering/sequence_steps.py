"""Steps of fields by a driver's own count."""

_SURE = 3
"""Fields of the other parity, each counted one further, after which a driver counts fields. Where both fields
of a frame share a number, every second difference is 0, unless fields are lost."""
_SURER = 12
"""Such fields after which a number that came twice was a repetition: were it that of a frame, every other
field would have had to be lost."""
_WRAP = 2**32  # V4L2 counts in 32 bits


class SequenceSteps:
    """Converts a driver's `sequence` into steps of fields.

    If each buffer holds one field, some drivers give both fields of a frame the same number and some number
    each field. Which, is learned from the stream: until then, and after the counter restarts, there is no
    answer.

    Args:
        alternate: True if each buffer holds one field, so that either numbering may occur; otherwise the
            counter counts fields.

    Attributes:
        restarted: True if the last field's number ran backward.
    """

    def __init__(self, alternate: bool) -> None:
        self._alternate = alternate
        self._newer: int | None = None
        self._single_steps = 0
        self._counts_fields = False
        self._last: tuple[int, int] | None = None
        self.restarted = False

    def forget(self) -> None:
        """Expect the counter to restart; its way of counting is remembered."""
        self._last = None

    def step(self, sequence: int | None, parity: int) -> int | None:
        """Number of fields since the last one by the driver's counter, or None if it cannot tell."""
        last, self._last = self._last, None if sequence is None else (sequence, parity)
        self.restarted = False
        if sequence is None or last is None:
            return None
        self._learn(sequence - last[0], parity, turned=parity != last[1])
        step = (self._index(sequence, parity) - self._index(*last)) % self._modulus
        # Half a wrap ahead or more means that the counter ran backward: it was restarted.
        self.restarted = self._known and step >= self._modulus // 2
        return step if self._known and 0 < step < self._modulus // 2 else None

    @property
    def _known(self) -> bool:
        return not self._alternate or self._newer is not None or self._counts_fields

    @property
    def _modulus(self) -> int:
        return _WRAP if self._newer is None else 2 * _WRAP

    def _learn(self, difference: int, parity: int, *, turned: bool) -> None:
        self._single_steps = self._single_steps + 1 if difference == 1 and turned else 0
        if self._single_steps >= (_SURE if self._newer is None else _SURER):
            self._counts_fields, self._newer = True, None
        if self._alternate and difference == 0:
            self._newer = parity

    def _index(self, sequence: int, parity: int) -> int:
        return sequence if self._newer is None else 2 * sequence + (parity == self._newer)
