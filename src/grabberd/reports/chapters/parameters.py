"""The result: both views' parameters with their σ, their misfit, and how the views compare."""

from collections.abc import Mapping, Sequence
from typing import Any

from grabberd.reports.chapters.head import alpha
from grabberd.reports.markup import Html, absent, element, joined, paragraph, table
from grabberd.reports.names import symbol
from grabberd.reports.numbers import (
    UNKNOWN,
    common_exponent,
    measured,
    power_of_ten,
    probability,
    significant,
)

Document = Mapping[str, Any]

_PURE = {None, "", "1"}


def result(document: Document) -> Html:
    """Parameters of the views beside each other, then the misfit."""
    return joined(_parameters(document["views"]), _misfit(document))


def comparison(document: Document) -> Html:
    """Left against right, parameter by parameter."""
    compared = document.get("comparison")
    if not compared:
        return absent("The views were not compared with each other.")
    heads = ["Parameter", "Unit", "Left", "Right", "Difference", "σ of it", "Statistic", "p", "Verdict"]
    rows = [_compared(row, alpha(document)) for row in compared]
    return joined(
        table("Left and right compared", heads, rows),
        paragraph(
            "The difference in units of its own standard deviation, correlations included. Views that look "
            "through one lens need not agree: each has its own mirrors, and its own half of the lens."
        ),
    )


def _parameters(views: Sequence[Mapping[str, Any]]) -> Html:
    known = [{row["name"]: row for row in view["parameters"]} for view in views]
    names = list(dict.fromkeys(name for view in known for name in view))
    if not names:
        return absent("The parameters of the views are not recorded.")
    heads: list[object] = ["Parameter", "Unit"]
    for view in views:
        paint = f"view {view['name']}" if view["name"] in {"left", "right"} else None
        heads += [element("span", view["name"], class_=paint), "± σ", "State"]
    rows = [_parameter(name, [view.get(name) for view in known]) for name in names]
    return joined(
        table("Parameters of the views, value and standard deviation", heads, rows, class_="parameters"),
        paragraph(
            "Adjusted: estimated here. Shared, tied: one unknown for several parameters. Held: fixed at the "
            "value given. Dropped: not significant, therefore fixed at zero. σ comes from the adjustment, "
            "scaled with σ₀, and is given to two digits. Where a local residual field was accepted, the "
            "calibration's own parameters differ from these: they belong to the field and are right with it "
            "alone. These are the ones to quote."
        ),
    )


def _parameter(name: str, found: Sequence[Mapping[str, Any] | None]) -> list[object]:
    exponent = common_exponent(
        [row["value"] for row in found if row] + [row.get("sigma") for row in found if row]
    )
    unit = next((row["unit"] for row in found if row), "")
    cells: list[object] = [symbol(name), _unit(unit, exponent)]
    for row in found:
        value = measured(row["value"], row.get("sigma"), exponent) if row else measured(None, None)
        cells += [value.value, value.sigma, _state(row)]
    return cells


def _state(row: Mapping[str, Any] | None) -> Html | str:
    if row is None:
        return UNKNOWN
    state, unknown = row.get("state", UNKNOWN), row.get("unknown") or ""
    if state != "adjusted":
        return element("span", state, class_="set")
    if unknown.startswith("lens."):
        return "shared"
    return "tied" if "=" in unknown else state


def _unit(unit: str | None, exponent: int) -> str:
    """The unit with the power of ten that was taken out; a pure number has none."""
    power = power_of_ten(exponent) if exponent else ""
    return f"{power} {'' if unit in _PURE else unit}".strip() or "1"


def _misfit(document: Document) -> Html:
    rms = document["result"].get("rms_px")
    if not rms:
        return absent("The misfit of each view is not recorded.")
    rows = [(view, significant(xy.get("x")), significant(xy.get("y"))) for view, xy in rms.items()]
    return table("RMS of the residuals [px]", ["View", "x", "y"], rows)


def _compared(row: Mapping[str, Any], level: float) -> list[object]:
    exponent = common_exponent([row.get("left"), row.get("right"), row.get("sigma")])
    sigma = row.get("sigma")
    sides = [measured(row.get(side), sigma, exponent).value for side in ("left", "right")]
    difference = measured(row.get("difference"), sigma, exponent)
    chance = row.get("p")
    verdict = UNKNOWN if chance is None else ("differ" if chance < level else "alike")
    return [
        symbol(row["parameter"]), _unit(row.get("unit"), exponent), *sides, difference.value,
        difference.sigma, significant(row.get("statistic")), probability(chance), verdict,
    ]  # fmt: skip
