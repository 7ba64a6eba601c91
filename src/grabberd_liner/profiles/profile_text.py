"""Profiles as people write and read them: YAML text into a checked document and back, changes in words.

A daemon has the quantities of a profile checked in a process of its own: what reads them would stay in it.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from textwrap import shorten
from typing import Any
from unicodedata import normalize

from pydantic import TypeAdapter, ValidationError

from grabberd.bounded_documents import as_written, parse_yaml, yaml_text
from grabberd.documents.document import JsonObject
from grabberd.errors import InputError
from grabberd.work.process import Processes
from grabberd_liner.profiles.documents import ProfileContent

QuantityCheck = Callable[[JsonObject], list[str]]
"""Finds the problems of a profile's quantities, each as a sentence with its key."""
_HINT = "docs/howto/profiles.md describes every key; configs/profiles has an example of each kind"
_NAMES = "a name has at most 64 letters, digits, blanks, '.', '_' and '-', and begins with a letter or digit"
_SHOWN = 100


def read_profile(text: str) -> JsonObject:
    """The document in a profile's YAML text, unchecked.

    Raises:
        InputError: It is no YAML, or has no keys.
    """
    try:
        document = parse_yaml(text)
    except ValueError as error:
        raise InputError(f"the profile cannot be read: {' '.join(str(error).split())}", _HINT) from error
    if not isinstance(document, dict):
        raise InputError(f"the profile has no keys: it is {str(document)[:_SHOWN]!r}", _HINT)
    return document


def write_profile(content: Mapping[str, Any]) -> str:
    """A profile's content as YAML text, which `read_profile` reads back."""
    return yaml_text(dict(content), width=100)


def checked_profile(document: Mapping[str, Any], check: QuantityCheck) -> JsonObject:
    """A profile's content: what the document says, without keys that say nothing.

    Args:
        document: The document.
        check: Finds what is wrong with the quantities in it.

    Raises:
        InputError: It is no profile, or has impossible values; the message lists every problem.
    """
    problems, content = _of_form(document)
    problems += check(content or dict(document))
    if problems or content is None:
        name = document.get("name")
        of = f" {name!r}"[:_SHOWN] if isinstance(name, str) else ""
        raise InputError(f"the profile{of} cannot be used: {'; '.join(problems)}", _HINT)
    return content


def plain_name(name: str) -> str:
    """A name or the value of a label as profiles are looked up by: letters with their marks in one character.

    Tablets differ in how they send the letters of other languages than English.
    """
    return normalize("NFC", name)


@cache
def _reader() -> TypeAdapter[Any]:
    return TypeAdapter(ProfileContent)


def _of_form(document: Mapping[str, Any]) -> tuple[list[str], JsonObject | None]:
    """Problems of keys, types and simple limits, and the content if there are none."""
    name = document.get("name")
    document = {**document, "name": plain_name(name)} if isinstance(name, str) else document
    try:
        profile = as_written(document, _reader().validate_python)
    except ValidationError as error:
        return [_in_words(one, document) for one in error.errors()], None
    except ValueError as error:
        return [str(error)], None
    content: JsonObject = profile.model_dump(mode="json", exclude_defaults=True)
    # In the sequence in which people read it; both have no default.
    return [], {"kind": content.pop("kind"), **content}


def _in_words(error: Any, document: Mapping[str, Any]) -> str:
    place = [one for at, one in enumerate(error["loc"]) if at or one != document.get("kind")]
    where = ".".join(str(one) for one in place)
    if error["type"].startswith("union_tag"):
        return f"kind: is {document.get('kind')!r}, expected liner, pulsator, cup or cow"
    if error["type"] == "missing":
        return f"{where}: is missing"
    if error["type"] == "extra_forbidden":
        return f"{where}: unknown key"
    if error["type"] == "value_error":
        return f"{where}: {error['ctx']['error']}"
    shown = shorten(repr(error["input"]), _SHOWN, placeholder=" …")
    said = _NAMES if error["type"] == "string_pattern_mismatch" else error["msg"]
    return f"{where}: {said[0].lower()}{said[1:]}; it is {shown}"


_LONGEST = 60


def changes_in_words(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Differences key by key, such as `material.E_mpa: 3.0 → 3.2`."""
    old, new = dict(_values(before, "")), dict(_values(after, ""))
    return [
        f"{key}: {_shown(old, key)} → {_shown(new, key)}"
        for key in dict.fromkeys([*old, *new])
        if (key in old) != (key in new) or old[key] != new[key]
    ]


def _values(value: object, key: str) -> Iterator[tuple[str, object]]:
    if isinstance(value, Mapping):
        for name, one in value.items():
            yield from _values(one, f"{key}.{name}" if key else str(name))
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for at, one in enumerate(value):
            yield from _values(one, f"{key}[{at}]")
    else:
        yield key, value


def _shown(values: Mapping[str, object], key: str) -> str:
    if key not in values:
        return "–"
    shown = str(values[key])
    return shown if len(shown) <= _LONGEST else shown[:_LONGEST] + "…"


PROBLEMS = "grabberd_liner.chain.analysis.profile_inputs:quantity_problems"
_CHECKED = frozenset({"material", "obtained", "analysis", "pulsation", "liner"})
"""Keys under which there are such quantities."""


def problems_in_process(processes: Processes, content: JsonObject) -> list[str]:
    """Problems of the quantities in a profile's document.

    Raises:
        StorageError: The process cannot be started, or does not answer in time.
    """
    if not _CHECKED & content.keys():
        return []
    # Dates and the like, which YAML knows and JSON does not, are refused as texts as well.
    return processes.ask(PROBLEMS, content, "checks profiles")
