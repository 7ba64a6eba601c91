"""The OpenAPI description as one self-contained page: no script, no other file, no other host."""

import base64
import hashlib
import html
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

TEMPLATES = Path(__file__).parent / "templates"
STYLE = (TEMPLATES / "docs.css").read_text(encoding="utf-8")
_HASH = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
POLICY = f"default-src 'none'; style-src 'sha256-{_HASH}'; base-uri 'none'; form-action 'none'"
"""The page's content security policy."""
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
Json = Mapping[str, Any]
"""A part of an OpenAPI description."""


def page(description: Json) -> str:
    """The OpenAPI description as an HTML page."""
    from jinja2 import Environment, FileSystemLoader  # noqa: PLC0415 - seldom asked for

    environment = Environment(loader=FileSystemLoader(TEMPLATES), autoescape=True, trim_blocks=True)
    environment.filters |= {"kind": type_in_words, "words": _text}
    environment.filters["written"] = lambda example: json.dumps(example, indent=1, ensure_ascii=False)
    operations = [
        {"method": method.upper(), "path": path, **operation}
        for path, methods in description["paths"].items()
        for method, operation in methods.items()
    ]
    tags = dict.fromkeys(one["tags"][0] for one in operations)
    groups = {tag: [one for one in operations if one["tags"][0] == tag] for tag in tags}
    template = environment.get_template("docs.html.jinja")
    return template.render(style=STYLE, groups=groups, **description)


def _text(words: str) -> str:
    """Escapes a text and turns backticks into code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(words))


def type_in_words(schema: Json) -> str:
    """A JSON schema's type in words, as HTML; a named type is a link."""
    if "$ref" in schema:
        name = html.escape(schema["$ref"].rpartition("/")[2])
        return f'<a href="#{name}">{name}</a>'
    if choices := schema.get("anyOf") or schema.get("oneOf"):
        return " or ".join(type_in_words(choice) for choice in choices)
    if values := schema.get("enum") or ([schema["const"]] if "const" in schema else None):
        return " or ".join(f"<code>{_json(value)}</code>" for value in values)
    return _plain_type(schema) + _limits(schema)


def _plain_type(schema: Json) -> str:
    if schema.get("type") == "array":
        return f"list of {type_in_words(schema.get('items', {}))}"
    inner = schema.get("additionalProperties")
    if schema.get("type") == "object" and isinstance(inner, Mapping):
        return f"object of {type_in_words(inner)}"
    return html.escape(str(schema.get("format") or schema.get("type") or "anything"))


def _limits(schema: Json) -> str:
    parts = [words.format(schema[key]) for key, words in LIMITS.items() if key in schema]
    return html.escape("".join(f", {part}" for part in parts))


def _json(value: object) -> str:
    return html.escape(json.dumps(value, ensure_ascii=False))
