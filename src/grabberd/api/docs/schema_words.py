"""The type of a value in words, from its JSON schema. Nothing else."""

import html
import json
from collections.abc import Mapping
from typing import Any

LIMITS = {
    "minimum": "≥ {}",
    "exclusiveMinimum": "> {}",
    "maximum": "≤ {}",
    "exclusiveMaximum": "< {}",
    "maxLength": "at most {} characters",
    "maxItems": "at most {}",
    "maxProperties": "at most {}",
    "pattern": "like {}",
}
Schema = Mapping[str, Any]


def words_of(schema: Schema) -> str:
    """The type in words, as HTML; one that has a name is a link to it."""
    if "$ref" in schema:
        name = html.escape(schema["$ref"].rpartition("/")[2])
        return f'<a href="#{name}">{name}</a>'
    if choices := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(words_of(choice) for choice in choices)
    if values := schema.get("enum") or ([schema["const"]] if "const" in schema else None):
        return " or ".join(f"<code>{_json(value)}</code>" for value in values)
    return _plain(schema) + _limits(schema)


def _plain(schema: Schema) -> str:
    if schema.get("type") == "array":
        return f"list of {words_of(schema.get('items', {}))}"
    inner = schema.get("additionalProperties")
    if schema.get("type") == "object" and isinstance(inner, Mapping):
        return f"object of {words_of(inner)}"
    return html.escape(str(schema.get("format") or schema.get("type") or "anything"))


def _limits(schema: Schema) -> str:
    said = [words.format(schema[key]) for key, words in LIMITS.items() if key in schema]
    return html.escape("".join(f", {words}" for words in said))


def _json(value: object) -> str:
    return html.escape(json.dumps(value, ensure_ascii=False))
