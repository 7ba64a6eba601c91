"""What the analysis was told, and where it comes from; nothing of it is assumed."""

from collections.abc import Mapping
from typing import Any

from grabberd.reports.markup import Html, absent, facts, items, joined
from grabberd.reports.names import label, spelled
from grabberd.reports.numbers import UNKNOWN

Document = Mapping[str, Any]


def inputs(document: Document) -> Html:
    """Capture, sources, every input as it was given."""
    known = document["inputs"]
    about = document.get("about") or {}
    sources = known.get("sources") or {}
    return joined(
        facts("The capture", [(label(key), spelled(value)) for key, value in about.items()]),
        facts("Where the inputs come from", [(name, said) for name, said in sources.items()])
        if sources
        else absent("Where the inputs come from is not recorded."),
        facts("Inputs as they were given", _given(known["given"])),
        facts(
            "How they were read",
            [
                ("Reference state", known.get("reference") or UNKNOWN),
                ("Heights of the sections", f"{spelled(known.get('heights_mm') or [])} mm"),
                ("Phases of the mean cycle", spelled(known.get("phases"))),
            ],
        ),
        items(known["lacks"]) if known.get("lacks") else Html(""),
    )


def _given(given: Mapping[str, Any], before: str = "") -> list[tuple[object, object]]:
    rows: list[tuple[object, object]] = []
    for key, value in given.items():
        if isinstance(value, Mapping):
            rows += _given(value, f"{before}{key}.")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for index, inner in enumerate(value, start=1):
                rows += _given(inner, f"{before}{key} {index}.")
        else:
            rows.append((f"{before}{key}", spelled(value)))
    return rows
