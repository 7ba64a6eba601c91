"""The calibration report: the values that its template cannot take from the document as they are."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from grabberd.reports.document import CALIBRATION, check_document, environment
from grabberd.reports.figures import require_matplotlib
from grabberd.reports.notation import Measured, common_exponent, fixed, measured, power_of_ten, symbol

Document = Mapping[str, Any]
Row = Mapping[str, Any]

_STRONG = 0.95
"""|ρ| above which a pair of unknowns is marked in the figure and listed in the table."""
_ALPHA = 0.05
_PURE = {None, "", "1"}


class ViewParameters(NamedTuple):
    """One view's columns of the table of parameters.

    Attributes:
        name: Name of the view.
        values: Values as text, one for each parameter.
        sigmas: Their σ as text.
        rows: The document's rows; None where the view lacks the parameter.
    """

    name: str
    values: Sequence[str]
    sigmas: Sequence[str]
    rows: Sequence[Row | None]


class Parameters(NamedTuple):
    """The table of parameters: symbols and units, and the columns of each view."""

    symbols: Sequence[str]
    units: Sequence[str]
    views: Sequence[ViewParameters]


class Compared(NamedTuple):
    """A parameter of the left view against the right one's, its numbers in one unit and as text."""

    symbol: str
    unit: str
    left: str
    right: str
    difference: str
    sigma: str
    statistic: float | None
    p: float | None


def calibration_html(document: Document) -> str:
    """Write the report of a calibration as one self-contained page, the same text for the same document.

    Args:
        document: "grabberd/calibration-report/1"; the report says which parts are null or missing.

    Raises:
        InputError: the document has another schema, lacks id, time, result or views, or has a number that is
            not finite.
        ExtraMissing: matplotlib is not installed.
    """
    check_document(document, CALIBRATION)
    require_matplotlib()
    return environment().render("calibration.html.jinja", document, **values(document))


def values(document: Document) -> dict[str, Any]:
    """Prepare the values of the template; its own comment describes them."""
    settings = document.get("settings") or {}
    return {
        "alpha": settings.get("alpha") or _ALPHA,
        "expected": _expected(document["result"].get("freedom"), settings),
        "parameters": _parameters(document["views"]),
        "compared": [_compared(row) for row in document.get("comparison") or []],
        "kept": {(row["view"], row["target"]) for row in document.get("residuals") or []},
        "movements": [_movement(row) for row in (document.get("validity") or {}).get("movements") or []],
        "strong": _strong(document.get("unknowns") or {}),
        "strong_from": _STRONG,
    }


def _expected(freedom: int | None, settings: Mapping[str, Any]) -> tuple[float, float] | None:
    """95 % range of σ₀ if the given σ are true, as only "honest" weights claim.

    σ₀ = √(Ω/r) is then nearly normal about 1 with variance 1/2r, r the degrees of freedom.
    """
    if not freedom or settings.get("weights") != "honest":
        return None
    reach = 1.96 / (2 * freedom) ** 0.5
    return 1 - reach, 1 + reach


def _parameters(views: Sequence[Mapping[str, Any]]) -> Parameters:
    known = [{row["name"]: row for row in view["parameters"]} for view in views]
    names = list(dict.fromkeys(name for rows in known for name in rows))
    exponents = [_exponent([rows[name] for rows in known if name in rows]) for name in names]
    units = [next(rows[name]["unit"] for rows in known if name in rows) for name in names]
    columns = [
        _view(view["name"], [rows.get(name) for name in names], exponents)
        for view, rows in zip(views, known, strict=True)
    ]
    return Parameters([*map(symbol, names)], [*map(_unit, units, exponents)], columns)


def _view(name: str, rows: Sequence[Row | None], exponents: Sequence[int]) -> ViewParameters:
    written = [_measured(row, exponent) for row, exponent in zip(rows, exponents, strict=True)]
    return ViewParameters(name, [one.value for one in written], [one.sigma for one in written], rows)


def _exponent(rows: Sequence[Row]) -> int:
    return common_exponent([row["value"] for row in rows] + [row.get("sigma") for row in rows])


def _measured(row: Row | None, exponent: int) -> Measured:
    return measured(row["value"], row.get("sigma"), exponent) if row else measured(None, None)


def _unit(unit: str | None, exponent: int) -> str:
    """The unit with the power of ten that was taken out; "1" for a pure number without one."""
    power = power_of_ten(exponent) if exponent else ""
    return f"{power} {'' if unit in _PURE else unit}".strip() or "1"


def _compared(row: Row) -> Compared:
    sigma = row.get("sigma")
    exponent = common_exponent([row.get("left"), row.get("right"), sigma])
    left, right = (measured(row.get(side), sigma, exponent).value for side in ("left", "right"))
    difference = measured(row.get("difference"), sigma, exponent)
    unit = _unit(row.get("unit"), exponent)
    return Compared(
        symbol(row["parameter"]), unit, left, right, *difference, row.get("statistic"), row.get("p")
    )


def _movement(row: Row) -> Mapping[str, str]:
    kind, _, axis = row["movement"].partition("_")
    what = f"picture shifted along {axis}" if kind == "shift" else f"camera turned about its {axis} axis"
    return {
        "view": row["view"],
        "movement": f"{what}, {row['amount']:g} {'px' if row['unit'] == 'px' else '°'}",
        "middle": _xyz(row["middle_mm"]),
        "corner": _xyz(row["corner_mm"]),
    }


def _xyz(values: Mapping[str, float | None]) -> str:
    known = [values[axis] for axis in "xyz"]
    return "not seen" if None in known else " / ".join(fixed(one, 4) for one in known)


def _strong(unknowns: Mapping[str, Any]) -> list[tuple[str, str, float]]:
    names, matrix = unknowns.get("names") or [], unknowns.get("correlation") or []
    pairs = [
        (names[column], names[row], rho)
        for row, line in enumerate(matrix)
        for column, rho in enumerate(line[:row])
        if rho is not None and abs(rho) > _STRONG
    ]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))
