"""Documents drawn from a schema, and valid ones with something changed, to hold readers to it."""

import copy
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

Path = tuple[str | int, ...]
ODD = (None, True, "", "x", -1, 0, 1, 0.5, 1e9, [], [1.0], {}, {"no_such_key": 1}, "2026-05-01T12:00:00Z")
"""Values that stand where others should."""
_TEXTS = st.text("abcxyz0189 .-", min_size=1, max_size=8)


def drawn_from(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    """Documents of a schema that is put together as in `grabberd.schemas.files`."""
    if "anyOf" in schema:
        return st.one_of([drawn_from(one) for one in schema["anyOf"]])
    if "const" in schema:
        return st.just(schema["const"])
    if "enum" in schema:
        return st.sampled_from(schema["enum"])
    made = {"object": _objects, "array": _arrays, "number": _numbers, "integer": _integers}.get(
        schema.get("type", "")
    )
    if made:
        return made(schema)
    return {
        "string": _TEXTS,
        "boolean": st.booleans(),
        "null": st.none(),
    }.get(schema.get("type", ""), st.sampled_from(ODD))


def _objects(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    keys = {name: drawn_from(one) for name, one in schema.get("properties", {}).items()}
    required = schema.get("required", ())
    optional = {name: one for name, one in keys.items() if name not in required}
    return st.fixed_dictionaries({name: keys[name] for name in required}, optional=optional)


def _arrays(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    least = schema.get("minItems", 0)
    if "prefixItems" in schema:
        return st.tuples(*map(drawn_from, schema["prefixItems"])).map(list)
    most = schema.get("maxItems", least + 2)
    return st.lists(drawn_from(schema["items"]), min_size=least, max_size=most)


def _numbers(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    low = schema.get("minimum", schema.get("exclusiveMinimum", -1e6))
    high = schema.get("maximum", schema.get("exclusiveMaximum", 1e6))
    return st.floats(
        low,
        high,
        exclude_min="exclusiveMinimum" in schema,
        exclude_max="exclusiveMaximum" in schema,
        allow_subnormal=False,
    )


def _integers(schema: dict[str, Any]) -> st.SearchStrategy[Any]:
    return st.integers(schema.get("minimum"), schema.get("maximum"))


@st.composite
def changed(draw: st.DrawFn, document: Any) -> Any:
    """The document with one to three of its values replaced, left out, or joined by an unknown key."""
    document = copy.deepcopy(document)
    for _ in range(draw(st.integers(1, 3))):
        places = list(_places(document))
        if places:
            _change(draw, document, draw(st.sampled_from(places)))
    return document


def _change(draw: st.DrawFn, document: Any, path: Path) -> None:
    *way, last = path
    for step in way:
        document = document[step]
    what = draw(st.sampled_from(("replace", "replace", "leave out", "add")))
    if what == "replace":
        document[last] = copy.deepcopy(draw(st.sampled_from(ODD)))
    elif what == "leave out":
        del document[last]
    elif isinstance(document, dict):
        document["no_such_key"] = 1


def _places(document: Any, path: Path = ()) -> Iterator[Path]:
    """Paths to every value within a document, of long lists only the first."""
    inner = document.items() if isinstance(document, dict) else enumerate(document[:2])
    for key, value in list(inner):
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from _places(value, (*path, key))
