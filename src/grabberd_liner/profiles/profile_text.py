"""Profiles as people write them: YAML text into a checked document, and back."""

from collections.abc import Callable, Mapping
from functools import cache
from textwrap import shorten
from typing import Any
from unicodedata import normalize

import yaml
from pydantic import TypeAdapter, ValidationError

from grabberd.bounded_documents import parse_yaml
from grabberd.documents.named_types import JsonObject
from grabberd.errors import InputError
from grabberd_liner.profiles.documents import ProfileContent

QuantityCheck = Callable[[JsonObject], list[str]]
"""Finds the problems of a profile's quantities, each as a sentence with its key."""
_HINT = "docs/howto/profiles.md describes every key; configs/profiles has an example of each kind"
_NAMES = "a name has at most 64 letters, digits, blanks, '.', '_' and '-', and begins with a letter or digit"
_SHOWN = 60


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
    text: str = yaml.safe_dump(dict(content), sort_keys=False, allow_unicode=True, width=100)
    return text


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
        profile = _reader().validate_python(document)
    except ValidationError as error:
        return [_in_words(one, document) for one in error.errors()], None
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
