"""Reading: the patience of whoever waits for it, limits of a JSON text, and documents in files.

Reading may take any time, by the size of what is asked for or by what a file contains. Whoever waits for it
says for how long, and gives up as soon as nobody wants it any more; whoever reads asks between its steps, and
stops. The two need not know each other: the patience in force travels with the context of the call.

Calibrations are JSON, all other documents YAML.
"""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from grabberd import runtime
from grabberd.bounded_documents import DEEPEST, LARGEST_DOCUMENT, parse_yaml, read_text
from grabberd.errors import InputError, ReadingGivenUp
from grabberd.tables import LARGEST_NUMBER


class Patience:
    """The time until which something is waited for; may end earlier, from any thread.

    Args:
        until_s: The end, by `now_s`; None: only `give_up` ends it.
        now_s: Source of time.
        outer: Patience that this one is a part of: over with it at the latest.
        between: Called between the steps of a reading, to let others go on.
    """

    __slots__ = ("_between", "_given_up", "_now_s", "_outer", "until_s")

    def __init__(
        self,
        until_s: float | None,
        now_s: Callable[[], float] = runtime.monotonic,
        outer: "Patience | None" = None,
        between: Callable[[], None] | None = None,
    ) -> None:
        self._between = between
        self.until_s = until_s
        self._now_s = now_s
        self._outer = outer
        self._given_up = False

    def give_up(self) -> None:
        """Ends it now; safe twice and from any thread."""
        self._given_up = True

    def between(self) -> None:
        """Lets others go on between two steps."""
        if self._between is not None:
            self._between()
        if self._outer is not None:
            self._outer.between()

    @property
    def is_over(self) -> bool:
        """True if nobody waits any longer: it was given up, or its time has passed."""
        if self._given_up or (self.until_s is not None and self._now_s() >= self.until_s):
            return True
        return self._outer is not None and self._outer.is_over


CURRENT: ContextVar[Patience | None] = ContextVar("patience", default=None)
"""The patience in force; None where somebody waits however long it takes, such as a command or a job."""


@contextmanager
def within(patience: Patience) -> Iterator[Patience]:
    """Puts a patience in force for the block, and restores the one before.

    A generator is resumed in the context of whoever asks for its next item: it is each resumption that has to
    be within the patience.
    """
    before = CURRENT.set(patience)
    try:
        yield patience
    finally:
        CURRENT.reset(before)


def is_over() -> bool:
    """True if there is a patience in force, and it is over."""
    patience = CURRENT.get()
    return patience is not None and patience.is_over


def check_patience(what: str = "it") -> None:
    """Ends a reading that nobody waits for any longer; called between its steps.

    Args:
        what: What is being read.

    Raises:
        ReadingGivenUp: The patience in force is over.
    """
    patience = CURRENT.get()
    if patience is None:
        return
    patience.between()
    if patience.is_over:
        raise given_up(what)


def given_up(what: str) -> ReadingGivenUp:
    """The error of a reading that was given up."""
    return ReadingGivenUp(
        f"reading {what} took too long and was given up",
        "ask for less at once, or again when the computer has less to do",
    )


LARGEST_INTEGER = 1 << 64
"""No number here is larger; times have 63 bits."""


def read_json(text: str) -> Any:
    """The value of a JSON text.

    Raises:
        ValueError: It is no JSON, too large or nested too deeply, or holds numbers or letters that no JSON
            text may hold.
    """
    if not isinstance(text, str):
        raise ValueError(f"a JSON text is {type(text).__name__}")
    if len(text) > LARGEST_DOCUMENT:
        raise ValueError(f"a JSON text has {len(text)} characters, more than {LARGEST_DOCUMENT}")
    try:
        value = json.loads(text)
    except RecursionError:
        raise ValueError("a JSON text is nested too deeply") from None
    check_json(value)
    return value


def check_json(value: Any) -> None:
    """Checks a value, level by level: recursion would end where the text's author wants it to.

    Raises:
        ValueError: See `read_json`.
    """
    level = [value]
    for _ in range(DEEPEST):
        level = [inner for outer in level for inner in _inner(outer)]
        if not level:
            return
    raise ValueError(f"a JSON text is nested in more than {DEEPEST} levels")


def _inner(value: Any) -> list[Any]:
    if isinstance(value, dict):
        return [*value, *value.values()]
    if isinstance(value, list):
        return value
    if isinstance(value, str) and not value.isascii():
        value.encode()  # a lone surrogate, which no answer could hold
    if isinstance(value, float) and not abs(value) <= LARGEST_NUMBER:
        raise ValueError(f"a JSON text holds {value}")
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER:
        raise ValueError("a JSON text holds an integer of more than 64 bits")
    return []


JsonObject = dict[str, Any]
PathLike = str | os.PathLike[str]
_EXAMPLES = "see the examples of calibrations, objects and calibration frames in the folder configs/"


def read_documents(calibration: Path | None, object_model: Path | None) -> JsonObject:
    """The documents in a calibration (JSON) and an object model (YAML) file, None without a file.

    Raises:
        InputError: A file is not valid JSON or YAML.
    """
    return {
        "calibration": None if calibration is None else _read(calibration, read_json),
        "object": None if object_model is None else read_yaml(object_model),
    }


def read_yaml(path: Path) -> JsonObject:
    """The document in a YAML file, such as an object model or a calibration frame.

    Raises:
        InputError: It cannot be read, or has no keys.
    """
    return _read(path, lambda text: parse_yaml(text, fast=True))


def document_of(given: PathLike | Mapping[str, Any]) -> dict[str, Any]:
    """The document in a YAML or JSON file, or the one that is given.

    Raises:
        InputError: The file cannot be read, or has no keys.
    """
    # JSON is YAML as well.
    return dict(given) if isinstance(given, Mapping) else read_yaml(Path(given))


def _read(path: Path, parse: Callable[[str], Any]) -> JsonObject:
    try:
        document = parse(read_text(path))
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}", "check the file's name") from error
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path} cannot be read: {reason}", _EXAMPLES) from error
    if document is None:
        raise InputError(f"{path} is empty: it has no keys", _EXAMPLES)
    if not isinstance(document, dict):
        raise InputError(f"{path} has no keys: it is {str(document)[:40]!r}", _EXAMPLES)
    return document
