"""Problems that did not end an analysis, as sentences: those that many states share are told once."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import pairwise
from typing import TypeVar

from grabberd.errors import AnalysisError

T = TypeVar("T")

_LISTED = 10
_ALIKE = 3
_TARGETS = ": targets "


class Problems:
    """Problems collected while an analysis is made."""

    def __init__(self, numbers: Sequence[int]) -> None:
        """Start with the gaps between `numbers`, the fields of a capture that have points."""
        self._of_whole: list[str] = _missing(numbers)
        self._of_states: dict[str, list[str]] = {}
        self._states: dict[str, int] = {}

    def survived(self, function: Callable[[], T]) -> T | None:
        """Return the function's result, or add a problem and return None if the data do not determine it."""
        try:
            return function()
        except AnalysisError as error:
            self.add(error.message)
            return None

    def add(self, problem: str) -> None:
        """Add a problem of the capture as a whole."""
        self._of_whole.append(problem)

    def note(self, state: str, problems: Iterable[str]) -> None:
        """Add the problems of one field or phase."""
        self._states[state] = len(self._states)
        for problem in problems:
            self._of_states.setdefault(problem, []).append(state)

    @property
    def latest(self) -> str:
        """The latest problem of the capture as a whole."""
        return self._of_whole[-1]

    @property
    def most_frequent(self) -> str:
        """The most frequent problem of fields and phases."""
        return max(self._of_states, key=lambda one: len(self._of_states[one]), default="there are none")

    def all(self) -> tuple[str, ...]:
        """Problems of the capture as a whole, then those of fields and phases.

        If more than a few differ only in their targets, they become one line that counts the targets.
        """
        of_states = (
            f"{_some(sorted(names, key=self._states.__getitem__))}: {problem}"
            for problem, names in _merged_by_kind(self._of_states).items()
        )
        return (*dict.fromkeys(self._of_whole), *of_states)


def _merged_by_kind(problems: Mapping[str, list[str]]) -> dict[str, list[str]]:
    alike: dict[str, list[str]] = {}
    for problem in problems:
        alike.setdefault(problem.partition(_TARGETS)[0], []).append(problem)
    merged = {}
    for head, members in alike.items():
        if len(members) > _ALIKE and all(_TARGETS in problem for problem in members):
            names = [name for problem in members for name in problems[problem]]
            merged[f"{head}{_TARGETS}{_counted(problems, members)}"] = names
        else:
            merged |= {problem: problems[problem] for problem in members}
    return merged


def _counted(problems: Mapping[str, list[str]], members: Sequence[str]) -> str:
    """Targets named by the problems with their counts, the most frequent first."""
    times = Counter[str]()
    for problem in members:
        for target in problem.partition(_TARGETS)[2].split(", "):
            times[target] += len(problems[problem])
    return _some([f"{target} ({many} times)" if many > 1 else target for target, many in times.most_common()])


def _missing(numbers: Sequence[int]) -> list[str]:
    """Fields without points between fields that have some."""
    gaps = [(before, after - before - 1) for before, after in pairwise(numbers) if after > before + 1]
    if not gaps:
        return []
    count, where = sum(many for _, many in gaps), [f"{many} after field {before}" for before, many in gaps]
    return [f"{count} fields are missing and were not filled in: {_some(where)}"]


def _some(names: Sequence[str]) -> str:
    rest = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {rest} more" if rest > 0 else "")
