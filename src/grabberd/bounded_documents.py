"""Documents that people write: limits of their size, depth and number of parts, and what their words mean.

A file of 300 bytes can be a YAML document of a gigabyte, one of 20 kB can be nested until the program ends.
All readers here raise ValueError, so that a caller reports it as any other fault of the document.

YAML is read by the core schema of version 1.2: 011 is eleven, 0o17 fifteen; 4:00, NO, on and dates are texts.
PyYAML by itself follows version 1.1, to which they are nine, an error, 240, false, true and dates. A text
that is a number or a truth value to it is an `OldWord`: where one is expected, whoever wrote it meant that.
"""

import codecs
import math
import re
from collections.abc import Callable, Iterator
from functools import lru_cache
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import yaml

from grabberd.tables import LARGEST_NUMBER

LARGEST_DOCUMENT = 16 << 20
"""Bytes of a document; an object model of 5000 targets has half a million."""
LARGEST_TABLE = 64 << 20
"""Bytes of a CSV file."""
MOST_PARTS = 1_000_000
"""Keys, values and lists of a YAML document, each counted as often as the document repeats it."""
DEEPEST = 40
"""Levels of nesting; a configuration has six."""
MARKS = {"utf-8": codecs.BOM_UTF8, "utf-16-le": codecs.BOM_UTF16_LE, "utf-16-be": codecs.BOM_UTF16_BE}
"""Byte order marks of the encodings that are read."""
_SAVE = "save it as UTF-8"
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
"""First bytes of the files of Excel and LibreOffice, new and old."""


def read_bounded(path: Path | Traversable, most: int = LARGEST_DOCUMENT) -> bytes:
    """The content of a file that has at most so many bytes.

    Raises:
        ValueError: It has more.
        OSError: It cannot be read.
    """
    with path.open("rb") as file:
        content = file.read(most + 1)  # a pipe or a device does not say how long it is
    if len(content) > most:
        raise ValueError(f"it has more than {most} bytes")
    return content


def read_text(path: Path | Traversable, most: int = LARGEST_DOCUMENT) -> str:
    """The text of a file; see `decoded`.

    Raises:
        ValueError: It is too large, or in another encoding.
        OSError: It cannot be read.
    """
    return decoded(read_bounded(path, most))


def encoding_of(content: bytes) -> tuple[str, bytes]:
    """Encoding of a text by its byte order mark, and the mark; UTF-8 and no bytes without one."""
    return next((found for found in MARKS.items() if content.startswith(found[1])), ("utf-8", b""))


def decoded(content: bytes) -> str:
    """A text in UTF-8, or in UTF-16 with a byte order mark; the mark is left out.

    Other encodings have no mark, and all of them can be read as one another: they are refused.

    Raises:
        ValueError: It is in another encoding.
    """
    if content.startswith(_WORKBOOKS):
        raise ValueError("it is a spreadsheet's own file, not a text: save it as CSV UTF-8")
    encoding, mark = encoding_of(content)
    try:
        text = content[len(mark) :].decode(encoding)
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, len(mark) + error.start) + 1
        wrong = content[len(mark) + error.start]
        why = f"line {line} has the byte 0x{wrong:02X}, which is not {encoding.upper()}"
        raise ValueError(f"{why}: {_SAVE}") from error
    if "\0" in text[:2]:
        raise ValueError(f"it has zero characters, as UTF-16 has without its byte order mark: {_SAVE}")
    return text


_TAG = "tag:yaml.org,2002:"
_CORE = (
    ("null", r"~|null|Null|NULL|", "~nN\0"),
    ("bool", r"true|True|TRUE|false|False|FALSE", "tTfF"),
    ("int", r"[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+", "-+0123456789"),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", "-+.0123456789"),
    ("float", r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", "-+."),
    ("merge", r"<<", "<"),
)
"""Words that are no texts: their tag, what they look like, what they begin with (NUL: there is nothing)."""


def _with_core(family: Any) -> None:
    for tag, words, begins in _CORE:
        first = ["" if one == "\0" else one for one in begins]
        family.add_implicit_resolver(_TAG + tag, re.compile(f"^(?:{words})$"), first)


class OldWord(str):
    """A text without quotes that was a number or a truth value to YAML 1.1, such as yes or 1_000.

    Its representation, with which messages show it, says where it stands and what to write for that value.
    """

    __slots__ = ("_told",)
    _told: str

    def __new__(cls, text: str, meant: bool | float, mark: Any) -> "OldWord":
        """The word that stood for `meant`, at PyYAML's `mark`; a text of one word needs no place."""
        self = super().__new__(cls, text)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark.line or mark.column else ""
        kind, spelling = (
            ("truth value", str(meant).lower()) if isinstance(meant, bool) else ("number", f"{meant!r}")
        )
        self._told = f"{place}a text in YAML 1.2; for a {kind} write {spelling}"
        return self

    def __repr__(self) -> str:
        return f"{super().__repr__()} ({self._told})"

    def __reduce__(self) -> tuple[type[str], tuple[str]]:
        return str, (str(self),)


_OLD_RESOLVER: Any = yaml.resolver.Resolver()
_OLD_SHORT = {"y": True, "Y": True, "n": False, "N": False}
"""Truth values of YAML 1.1 that not even PyYAML takes for such."""


@lru_cache(1000)
def _old_meaning(text: str) -> bool | float | None:
    """The number or truth value that a word without quotes was to YAML 1.1; None for a text."""
    if text in _OLD_SHORT:
        return _OLD_SHORT[text]
    tag = str(_OLD_RESOLVER.resolve(yaml.ScalarNode, text, (True, False)))
    try:
        return yaml.safe_load(text) if tag.removeprefix(_TAG) in ("bool", "int", "float") else None
    except ValueError:  # such as 0x_, of which its pattern says that it is a number
        return None


class _Loader(yaml.SafeLoader):
    """The core schema alone."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012 - where PyYAML looks for them

    def construct_yaml_str(self, node: yaml.ScalarNode) -> str:
        text = str(self.construct_scalar(node))
        meant = None if node.style else _old_meaning(text)
        return text if meant is None else OldWord(text, meant, node.start_mark)

    def construct_yaml_int(self, node: yaml.ScalarNode) -> int:
        words = str(self.construct_scalar(node))
        return int(words, {"0o": 8, "0x": 16}.get(words[:2], 10))


class _FastLoader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """The same in C, if PyYAML has it: ten times as fast, with shorter words for what is wrong."""

    yaml_implicit_resolvers = _Loader.yaml_implicit_resolvers
    construct_yaml_str = _Loader.construct_yaml_str
    construct_yaml_int = _Loader.construct_yaml_int


class _Dumper(yaml.SafeDumper):
    """Quotes texts that either version of YAML would take for something else."""


for _family in (_Loader, _FastLoader):
    _family.add_constructor(_TAG + "str", _Loader.construct_yaml_str)
    _family.add_constructor(_TAG + "int", _Loader.construct_yaml_int)
_with_core(_Loader)  # and so the fast one
_with_core(_Dumper)
_Dumper.add_representer(OldWord, _Dumper.represent_str)


def yaml_text(value: Any, **options: Any) -> str:
    """A value as YAML that `parse_yaml`, and any other program, reads as the same.

    Args:
        value: Made of mappings, lists and plain values.
        **options: Those of `yaml.dump`; by default keys stay in their order, and letters what they are.
    """
    return yaml.dump(value, Dumper=_Dumper, **{"sort_keys": False, "allow_unicode": True, **options})


def parse_yaml(text: str, *, fast: bool = False) -> Any:
    """The value of a YAML document.

    Args:
        text: The document.
        fast: For what may be large, such as object models.

    Raises:
        ValueError: It is no YAML, gives a key twice, is too deep or too large, or repeats parts of itself too
            often.
    """
    loader = _FastLoader if fast else _Loader
    if len(text) > LARGEST_DOCUMENT:
        raise ValueError(f"it has more than {LARGEST_DOCUMENT} characters")
    try:
        # Of events alone: they come one by one, whatever they stand for.
        _check_parts(yaml.parse(text, Loader=loader))
        return yaml.load(text, Loader=loader)  # noqa: S506 - both are safe
    except (yaml.YAMLError, RecursionError, OverflowError, TypeError, AttributeError) as error:
        # The last two are what PyYAML raises for tags that do not suit their values.
        raise ValueError(f"not valid YAML: {error}") from error


def as_written(value: Any, read: Callable[[Any], Any]) -> Any:
    """Reads a document, or a part of one such as a value, without taking a text for something else.

    Raises:
        ValueError: It has made a number or a truth value of a text, as of yes and 1_000, or the number is too
            large; or as the reader.
    """
    result = read(value)
    for key, word, taken in _taken(value, result, ""):
        kind = "true or false" if isinstance(taken, bool) else "a number"
        raise ValueError(f"{key}{': ' if key else ''}{word!r} is not {kind}")
    if isinstance(result, float) and LARGEST_NUMBER < abs(result) < math.inf:
        raise ValueError(f"{result:g} is larger than {LARGEST_NUMBER:g}")
    return result


def _taken(value: Any, result: Any, key: str) -> Iterator[tuple[str, OldWord, float]]:
    """The words that were taken for numbers or truth values: their keys, they themselves, and for which."""
    if isinstance(value, OldWord):
        if isinstance(result, int | float):
            yield key, value, result
    elif isinstance(value, list) and isinstance(result, list | tuple):
        for at, (part, taken) in enumerate(zip(value, result, strict=False)):
            yield from _taken(part, taken, f"{key}[{at}]")
    elif isinstance(value, dict):
        for name, part in value.items():
            taken = result.get(name) if isinstance(result, dict) else getattr(result, str(name), None)
            yield from _taken(part, taken, f"{key}.{name}" if key else str(name))


def _check_parts(events: Iterator[Any]) -> None:
    """Counts the parts of a document, repetitions included.

    Raises:
        ValueError: There are too many, it is too deep, or a part contains itself.
        YAMLError: A key is given twice, of which plain YAML silently keeps the last.
    """
    within = [_Collection(None, 0)]
    known: dict[str, int] = {}
    for event in events:
        if isinstance(event, yaml.NodeEvent):
            within[-1].see(event)
        if isinstance(event, yaml.CollectionStartEvent):
            within.append(_Collection(event, len(within)))
        elif isinstance(event, yaml.CollectionEndEvent):
            done = within.pop()
            within[-1].add(done.parts, done.start.anchor, known)
        elif isinstance(event, yaml.ScalarEvent):
            within[-1].add(1, event.anchor, known)
        elif isinstance(event, yaml.AliasEvent):
            if event.anchor not in known:
                raise ValueError(f"the part {event.anchor!r} contains itself, or is not there")
            within[-1].add(known[event.anchor], None, known)


class _Collection:
    """A mapping or list that has begun, or the document: its parts so far, and a mapping's keys."""

    def __init__(self, start: Any, depth: int) -> None:
        if depth >= DEEPEST:
            raise ValueError(f"it is nested in more than {DEEPEST} levels")
        self.start, self.parts = start, min(depth, 1)
        self._keys: set[str] = set()
        self._is_mapping = self._is_key = isinstance(start, yaml.MappingStartEvent)

    def see(self, event: Any) -> None:
        """Takes note of what it holds; the keys and values of a mapping take turns."""
        if self._is_key and isinstance(event, yaml.ScalarEvent):
            if event.value in self._keys:
                words = f"the key {event.value!r} is given twice"
                raise yaml.constructor.ConstructorError(None, None, words, self.start.start_mark)
            self._keys.add(event.value)
        self._is_key = self._is_mapping and not self._is_key

    def add(self, parts: int, anchor: str | None, known: dict[str, int]) -> None:
        """Counts what it holds, for repetitions by the anchor too."""
        self.parts += parts
        if anchor is not None:
            known[anchor] = parts
        if self.parts > MOST_PARTS:
            raise ValueError(f"it has more than {MOST_PARTS} parts, repeated ones included")
