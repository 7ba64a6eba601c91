"""Marks the repeated pictures of a recording: they show no new moment, so what they show has another time.

Where nothing moved between the pictures before and after, the repeated one shows what was there: it stays a
picture like the others.
"""

from collections import deque
from collections.abc import Iterator

from grabberd.core.chain.repeats import RepeatJudge, moved
from grabberd.core.field import Field
from grabberd.instrument.acquisition import REPEATED, GrabbedField
from grabberd_replay.recording import Batch

_WAITING = 25
"""Pictures that wait at most for one that repeats nothing."""
_BEFORE_NS, _FEWEST_CHANGED = 2_000_000_000, 3
"""Where none comes, it is frozen if so many changed in the time before: a camera's noise does not end."""


class RepeatMarks:
    """Passes a recording's pictures on, the repeated ones marked.

    Args:
        fields: number of fields in a picture.
    """

    def __init__(self, fields: int) -> None:
        self._by_parity = fields > 1
        self._judge = RepeatJudge(of_any_parity=not self._by_parity)
        self._changed: dict[int, Field] = {}
        self._changed_ns: deque[int] = deque(maxlen=_FEWEST_CHANGED)
        self._hides: dict[int, bool] = {}
        self._waiting: deque[list[tuple[GrabbedField, bool]]] = deque()

    def take(self, batch: Batch) -> Iterator[Batch]:
        """The pictures of which it is known by now what they are, after this one."""
        judged = [(one, self._judge.take(one.field)) for one in batch]
        self._waiting.append(judged)
        if not any(repeated for _, repeated in judged):
            yield from self._released({self._key(one.field): one.field for one, _ in judged})
        elif len(self._waiting) > _WAITING:
            yield from self._released({})

    def end(self) -> Iterator[Batch]:
        """All others, since no more pictures come."""
        yield from self._released({})

    def _released(self, after: dict[int, Field]) -> Iterator[Batch]:
        """Pictures that wait; `after` has the fields that were the first to change again."""
        for key in after:
            self._hides.pop(key, None)
        while self._waiting:
            batch: list[GrabbedField] = []
            for one, repeated in self._waiting.popleft():
                key = self._key(one.field)
                if not repeated:
                    self._changed[key] = one.field
                    self._changed_ns.append(one.time_ns)
                    self._hides.pop(key, None)
                    batch.append(one)
                    continue
                if key not in self._hides:
                    self._hides[key] = self._has_moved(key, after, one.time_ns)
                batch.append(one._replace(damage=REPEATED) if self._hides[key] else one)
            yield batch

    def _has_moved(self, key: int, after: dict[int, Field], time_ns: int) -> bool:
        before = self._changed.get(key)
        if before is not None and key in after:
            return moved(before, after[key])
        recent = [one for one in self._changed_ns if one >= time_ns - _BEFORE_NS]
        return len(recent) == _FEWEST_CHANGED

    def _key(self, field: Field) -> int:
        return field.parity if self._by_parity else 0
