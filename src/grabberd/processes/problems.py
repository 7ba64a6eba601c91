"""What an analysis survived, in words: each problem once, with the fields and phases that have it."""

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import TypeVar

from grabberd.errors import AnalysisError

T = TypeVar("T")

_LISTED = 10


class Problems:
    """Collected while an analysis is made."""

    def __init__(self, numbers: Sequence[int]) -> None:
        """With what there is to say of a capture whose fields `numbers` have points."""
        self._of_whole: list[str] = _missing(numbers)
        self._of_states: dict[str, list[str]] = {}

    def survived(self, function: Callable[[], T]) -> T | None:
        """What the function makes, or None where the data do not determine it."""
        try:
            return function()
        except AnalysisError as error:
            self.add(error.message)
            return None

    def add(self, problem: str) -> None:
        """Of the capture as a whole."""
        self._of_whole.append(problem)

    def note(self, state: str, problems: Iterable[str]) -> None:
        """Of one field or phase."""
        for problem in problems:
            self._of_states.setdefault(problem, []).append(state)

    @property
    def latest(self) -> str:
        """Of the capture as a whole."""
        return self._of_whole[-1]

    @property
    def most_frequent(self) -> str:
        """Of its fields."""
        return max(self._of_states, key=lambda words: len(self._of_states[words]), default="there are none")

    def all(self) -> tuple[str, ...]:
        """Those of the whole, then those of the fields and phases."""
        of_states = (f"{_some(names)}: {words}" for words, names in self._of_states.items())
        return (*dict.fromkeys(self._of_whole), *of_states)


def _missing(numbers: Sequence[int]) -> list[str]:
    """Fields without points, between others that have some."""
    gaps = [(before, after - before - 1) for before, after in pairwise(numbers) if after > before + 1]
    if not gaps:
        return []
    count, where = sum(many for _, many in gaps), [f"{many} after field {before}" for before, many in gaps]
    return [f"fields are missing, {count} in all, and nothing stands in for them: {_some(where)}"]


def _some(names: Sequence[str]) -> str:
    rest = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {rest} more" if rest > 0 else "")
