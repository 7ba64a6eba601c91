"""The OpenAPI description as one self-contained page: no script, no other file, no other host."""

import base64
import hashlib
import html
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1c2024; }
main { max-width: 60rem; margin: 0 auto; padding: 1rem; }
h2 { border-bottom: 2px solid #1c2024; margin-top: 3rem; }
h3 { margin-bottom: .2rem; }
code { font-family: ui-monospace, monospace; overflow-wrap: anywhere; }
table { border-collapse: collapse; width: 100%; margin: .5rem 0; }
pre { overflow-x: auto; font-size: .85rem; }
th, td { text-align: left; vertical-align: top; padding: .25rem .6rem .25rem 0; }
th, td { border-bottom: 1px solid #d0d5da; }
.role { color: #4c555d; }
a { color: #0b5394; }
@media (prefers-color-scheme: dark) {
  body { background: #16191c; color: #e4e7ea; } a { color: #8ab8e8; } .role { color: #aab3bb; }
  h2 { border-color: #e4e7ea; } th, td { border-color: #3a4148; }
}
"""
_HASH = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
POLICY = f"default-src 'none'; style-src 'sha256-{_HASH}'; base-uri 'none'; form-action 'none'"
"""The page's content security policy."""
STREAMS = (
    "<code>WebSocket /api/v1/preview?device=NAME</code> (viewer) sends a small binary message for the newest "
    "field, at most twelve a second: header, centroids, deflated bits."
)
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
    info, schemas = description["info"], description["components"]["schemas"]
    title = f"{html.escape(info['title'])} {html.escape(info['version'])}"
    body = [
        f"<h1>{title}</h1><p>{html.escape(info['description'])}</p>",
        '<p>For programs: <a href="/api/v1/openapi.json">openapi.json</a>. Errors are problem documents '
        f"(RFC 9457) with a <code>hint</code>. Times are UTC.</p><p>{STREAMS}</p>",
        _contents(description["paths"]),
        *_operations(description["paths"]),
        "<h2>Problems</h2>",
        _problems(description["components"]["responses"]),
        "<h2>Documents</h2>",
        *(_schema(name, schema) for name, schema in sorted(schemas.items())),
    ]
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width"><title>{title}</title>'
    main = "\n".join(body)
    return (
        f'<!doctype html><html lang="en"><head>{head}<style>{STYLE}</style></head>'
        f"<body><main>{main}</main></body></html>"
    )


def _contents(paths: Mapping[str, Json]) -> str:
    """The summaries of all operations, group by group."""
    groups: dict[str, list[str]] = {}
    for operation in (one for methods in paths.values() for one in methods.values()):
        link = f'<a href="#{operation["operationId"]}">{html.escape(operation["summary"])}</a>'
        groups.setdefault(operation["tags"][0], []).append(link)
    rows = ((f"<b>{html.escape(tag)}</b>", " · ".join(links)) for tag, links in groups.items())
    return f"<nav>{_table(('group', 'what it does'), rows)}</nav>"


def _problems(responses: Mapping[str, Json]) -> str:
    rows = ((name.removeprefix("Problem"), _text(one["description"])) for name, one in responses.items())
    return _table(("status", "meaning"), rows)


def _operations(paths: Mapping[str, Json]) -> Iterator[str]:
    tagged: dict[str, list[str]] = {}
    for path, methods in paths.items():
        for method, operation in methods.items():
            tag = operation.get("tags", ["other"])[0]
            tagged.setdefault(tag, []).append(_operation(method, path, operation))
    for tag, operations in tagged.items():
        yield f"<h2>{html.escape(tag)}</h2>"
        yield from operations


def _operation(method: str, path: str, operation: Json) -> str:
    role = operation.get("x-least-role")
    who = html.escape(role) if role else "no token needed"
    parts = [
        f'<section id="{html.escape(operation["operationId"])}">',
        f"<h3>{html.escape(operation['summary'])}</h3>",
        f'<p><b>{method.upper()}</b> <code>{html.escape(path)}</code> <span class="role">{who}</span></p>',
        f"<p>{_text(operation.get('description', ''))}</p>",
        _parameters(operation.get("parameters", [])),
        _body(operation.get("requestBody")),
        _responses(operation["responses"]),
        "</section>",
    ]
    return "\n".join(filter(None, parts))


def _parameters(parameters: Iterable[Json]) -> str:
    rows = [
        (f"<code>{html.escape(one['name'])}</code>", one["in"], _if_given(one["schema"]), _described(one))
        for one in parameters
    ]
    return _table(("parameter", "in", "type", "meaning"), rows) if rows else ""


def _if_given(schema: Json) -> str:
    """A parameter's type, without the null that stands for leaving it out."""
    choices = [choice for choice in schema.get("anyOf", ()) if choice.get("type") != "null"]
    return type_in_words(choices[0] if len(choices) == 1 else schema)


def _body(body: Json | None) -> str:
    if body is None:
        return ""
    kinds = (f"{html.escape(kind)}: {type_in_words(one['schema'])}" for kind, one in body["content"].items())
    return f"<p>Body: {', '.join(kinds)}</p>"


def _responses(responses: Mapping[str, Json]) -> str:
    rows = [(status, _content(one), _described(one)) for status, one in responses.items() if status < "400"]
    refusals = ", ".join(status for status in responses if status >= "400")
    return _table(("status", "response", "meaning"), rows) + f'<p class="role">Problems: {refusals}</p>'


def _content(response: Json) -> str:
    kinds = response.get("content", {})
    return "<br>".join(f"{html.escape(kind)} {_of(one)}" for kind, one in kinds.items()) or "nothing"


def _of(content: Json) -> str:
    schema = content.get("schema")
    return type_in_words(schema) if schema and schema != {"type": "string"} else ""


def _schema(name: str, schema: Json) -> str:
    required = schema.get("required", [])
    rows = [
        (
            f"<code>{html.escape(key)}</code>",
            type_in_words(one),
            "required" if key in required else "",
            _described(one),
        )
        for key, one in schema.get("properties", {}).items()
    ]
    table = (
        _table(("key", "type", "required", "meaning"), rows) if rows else f"<p>{type_in_words(schema)}</p>"
    )
    head = f'<section id="{html.escape(name)}"><h3>{html.escape(name)}</h3>'
    examples = "".join(_example(one) for one in schema.get("examples", ()))
    return f"{head}<p>{_text(schema.get('description', ''))}</p>{table}{examples}</section>"


def _example(example: object) -> str:
    text = html.escape(json.dumps(example, indent=1, ensure_ascii=False), quote=False)
    return f"<details><summary>Example</summary><pre>{text}</pre></details>"


def _described(one: Json) -> str:
    words = one.get("description", "")
    return "" if words == "Successful Response" else _text(words)


def _text(words: str) -> str:
    """Escapes a text and turns backticks into code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", html.escape(words))


def _table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = "".join(f'<th scope="col">{words}</th>' for words in heads)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


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
