"""The captures that a study is asked for, in words: folders, and conditions such as liner=A,B."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple, Self

from grabberd.archive.capture.schema import PART, SUFFIX
from grabberd.errors import InputError
from grabberd_liner.analyses.store import DOCUMENT
from grabberd_liner.chain.study.study import VERDICT, Studied

SINCE, UNTIL = "since", "until"
_VERDICTS = ("complete", "incomplete")
_CAPTURES = (SUFFIX, SUFFIX + PART)


class Condition(NamedTuple):
    """Values of which a capture must have one under a name."""

    key: str
    values: tuple[str, ...]

    def holds(self, capture: Studied) -> bool:
        """True if a capture meets it."""
        if self.key == SINCE:
            return _moment(capture.captured_utc) >= _moment(self.values[0])
        if self.key == UNTIL:
            return _moment(capture.captured_utc) < _moment(self.values[0])
        return capture.value_of(self.key) in self.values


class Selection(NamedTuple):
    """Folders of results, and conditions that all have to be met."""

    folders: tuple[Path, ...]
    conditions: tuple[Condition, ...]

    @classmethod
    def of(cls, words: Sequence[str]) -> Self:
        """A selection in the words of the command line; what exists as a path is one.

        Raises:
            InputError: A word is neither; it tells which, and what to do about it.
        """
        folders, conditions = [], []
        for word in words:
            if Path(word).exists() or "=" not in word:
                folders.append(_folder(Path(word)))
            else:
                conditions.append(_condition(word))
        return cls(tuple(folders), tuple(conditions))

    def matches(self, capture: Studied, *, but_verdict: bool = False) -> bool:
        """True if a capture meets all conditions.

        Args:
            capture: The capture.
            but_verdict: True to leave the verdict aside, which takes opening the file to know.
        """
        asked = (one for one in self.conditions if not (but_verdict and one.key == VERDICT))
        return all(one.holds(capture) for one in asked)

    def single(self, key: str) -> str | None:
        """The value that a condition asks for, if there is one and it has no alternatives."""
        found = [one.values for one in self.conditions if one.key == key]
        return found[0][0] if len(found) == 1 and len(found[0]) == 1 else None


def _folder(path: Path) -> Path:
    if path.is_dir():
        return path
    if path.name == DOCUMENT and path.is_file():
        return path.parent
    if path.name.endswith(_CAPTURES):
        raise InputError(
            f"{path} is a capture, and a study takes analyses",
            f"analyse it first: grabberd analyse {path} --profiles --out {path.stem}-analysis",
        )
    what = "is no folder" if path.exists() else "does not exist, and is no condition"
    raise InputError(
        f"{path} {what}",
        f"give folders that grabberd analyse --out has made (with {DOCUMENT} in them), folders of such "
        "folders, or conditions on the archive such as liner=A,B",
    )


def _condition(word: str) -> Condition:
    key, _, values = (part.strip() for part in word.partition("="))
    condition = Condition(key, tuple(one.strip() for one in values.split(",") if one.strip()))
    if not key or not condition.values:
        raise InputError(f"{word!r} is no condition", "give NAME=VALUE, or NAME=VALUE,OTHER")
    if key in (SINCE, UNTIL):
        if len(condition.values) > 1:
            raise InputError(f"{word!r} has several times", f"give one: {key}=2026-11-01")
        _moment(condition.values[0], word)
    if key == VERDICT and (unknown := set(condition.values) - set(_VERDICTS)):
        raise InputError(f"there is no verdict {', '.join(unknown)}", f"choose from {', '.join(_VERDICTS)}")
    return condition


def _moment(text: str, word: str = "") -> datetime:
    """A day or a time in UTC; one without a zone is in UTC already."""
    try:
        moment = datetime.fromisoformat(text)
        return moment.astimezone(UTC) if moment.tzinfo else moment.replace(tzinfo=UTC)
    except (ValueError, OverflowError):
        hint = "write days as 2026-11-01, times as 2026-11-01T06:30"
        raise InputError(f"{word or text!r} is no day or time", hint) from None
