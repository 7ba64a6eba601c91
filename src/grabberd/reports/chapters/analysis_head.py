"""What stands at the top of an analysis: which capture, what was found, what lacks and what went wrong."""

from collections.abc import Mapping
from typing import Any

from grabberd.reports.columns import Columns
from grabberd.reports.markup import Html, element, facts, items, joined, paragraph
from grabberd.reports.names import instant
from grabberd.reports.numbers import UNKNOWN, count

Document = Mapping[str, Any]

_SHOWN = 12


def analysis_head(document: Document) -> Html:
    """Title, verdict, the result in numbers, what lacks, problems."""
    origin = joined(
        "Capture ", element("strong", document["id"]), ", analysed ", instant(document["created_utc"]),
        " by grabberd ", document.get("version") or "of an unknown version", ".",
    )  # fmt: skip
    note = (document.get("about") or {}).get("note")
    return element(
        "header",
        element("h1", "Analysis report"),
        paragraph(origin),
        *([paragraph(note)] if note else []),
        paragraph(_verdict(document), class_="verdict"),
        facts("Result at a glance (± is one σ)", _glance(document)),
        _box("What was not given", document["inputs"].get("lacks") or (), "Every input was given."),
        _box("Problems", document.get("problems") or (), "There were no problems."),
    )


def _verdict(document: Document) -> str:
    summary = Columns(document["tables"]["summary"])
    fields = f"{_whole(summary, 'analysed')} of {_whole(summary, 'fields')} fields were analysed"
    return " ".join([f"{fields}.", _pulsation(summary), _pressure(document)])


def _pulsation(summary: Columns) -> str:
    if not summary.is_known("period_s"):
        return "No pulsation was found."
    return f"The wall pulsates {summary.said('rate_per_min')}, a cycle takes {summary.said('period_s')}."


def _pressure(document: Document) -> str:
    known = strongest(document)
    if known is None:
        return "The pressure on the teat could not be determined."
    table, row, where = known
    return (
        f"The mean pressure of the liner is greatest {where}: "
        f"{table.cell('mean_contact_kpa', row)} kPa (σ in brackets)."
    )


def strongest(document: Document) -> tuple[Columns, int, str] | None:
    """Where the mean pressure is greatest, by the mean cycle if there is one; None where there is none."""
    for name, key, said in (("phases", "phase", "at phase {:.2f}"), ("fields", "n", "in field {:.0f}")):
        table = Columns(document["tables"][name])
        if table.is_known("mean_contact_kpa"):
            values = table.numbers("mean_contact_kpa")
            row = max(range(len(table)), key=lambda k: values[k] if values[k] == values[k] else float("-inf"))
            return table, row, said.format(table.one(key, row) or 0.0)
    return None


def _glance(document: Document) -> list[tuple[object, object]]:
    summary = Columns(document["tables"]["summary"])
    rows: list[tuple[object, object]] = [
        ("Fields analysed / with points / missing", _counts(summary)),
        ("Cycle", summary.said("period_s")),
        ("Rate", summary.said("rate_per_min")),
        ("Cycles", summary.said("cycles", 1)),
        ("Stroke of the target that moves most", summary.said("stroke_mm", 2)),
        ("Ratio by the wall's movement", summary.said("wall_ratio")),
        ("Ratio by the vacuum (ISO 5707)", summary.said("iso_ratio")),
    ]
    if summary.is_known("offset_s"):
        rows.append(("Camera's time less the vacuum's", summary.said("offset_s")))
    if summary.is_known("touch_n"):
        where = f"field {_whole(summary, 'touch_n')}, target {_whole(summary, 'touch_target')}"
        rows.append(
            ("Pressure is there already in" if touches_at_once(document) else "Pressure begins in", where)
        )
    return rows


def touches_at_once(document: Document) -> bool:
    """Whether there is pressure in the first field already, so that its beginning is not seen."""
    first = Columns(document["tables"]["fields"]).one("n")
    return first is not None and Columns(document["tables"]["summary"]).one("touch_n") == first


def _counts(summary: Columns) -> str:
    return " / ".join(_whole(summary, name) for name in ("analysed", "fields", "missing"))


def _whole(summary: Columns, name: str) -> str:
    value = summary.one(name)
    return UNKNOWN if value is None else count(round(value))


def _box(title: str, lines: Any, none: str) -> Html:
    if not lines:
        return element("section", paragraph(none), class_="box", aria_label=title)
    more = lines[_SHOWN:]
    rest = [element("details", element("summary", f"{len(more)} more"), items(more))] if more else []
    return element(
        "section",
        element("h2", title),
        items(lines[:_SHOWN]),
        *rest,
        class_="box warned",
        aria_label=title,
    )
