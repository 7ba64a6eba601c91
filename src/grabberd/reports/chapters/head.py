"""What stands at the top: which calibration this is, how it came out, and what to be warned of."""

from collections.abc import Mapping
from typing import Any

from grabberd.reports.markup import Html, element, facts, items, joined, paragraph
from grabberd.reports.names import instant, spelled
from grabberd.reports.numbers import chance, count, fixed, significant

Document = Mapping[str, Any]

_EQUALS = "\u00a0=\u00a0"


def head(document: Document) -> Html:
    """Title, verdict, the result in numbers, warnings."""
    origin = joined(
        "Calibration ", element("strong", document["id"]), ", made ", instant(document["created_utc"]),
        " by ", document.get("version") or "an unknown version of grabberd", ".",
    )  # fmt: skip
    return element(
        "header",
        element("h1", "Calibration report"),
        paragraph(origin),
        *([paragraph(document["note"])] if document.get("note") else []),
        paragraph(verdict(document), class_="verdict"),
        facts("Result at a glance", _glance(document)),
        _warnings(document),
    )


def verdict(document: Document) -> str:
    """The outcome in a few sentences."""
    return " ".join([_fit(document), _model(document), _field(document), _checked(document)])


def alpha(document: Document) -> float:
    """The level of all tests."""
    return float((document.get("settings") or {}).get("alpha") or 0.05)


def _fit(document: Document) -> str:
    result = document["result"]
    unit, pixels = significant(result.get("sigma0")), significant(result.get("sigma0_px"))
    freedom = count(result.get("freedom"))
    return (
        f"σ₀{_EQUALS}{unit} with {freedom} degrees of freedom; an image coordinate of mean weight has "
        f"σ{_EQUALS}{pixels}\u00a0px."
    )


def _model(document: Document) -> str:
    kept = len((document.get("unknowns") or {}).get("names") or [])
    dropped = len(document.get("dropped") or [])
    adjusted = f"{kept} unknowns were adjusted" if kept else "The number of unknowns is not recorded"
    return f"{adjusted}, {dropped or 'none'} dropped as not significant; {_blunders(document)}."


def _blunders(document: Document) -> str:
    blunders = document.get("blunders")
    if blunders is None:
        return "blunders were not sought"
    return f"{len(blunders) or 'no'} blunder{'s' * (len(blunders) != 1)} found"


def _field(document: Document) -> str:
    field = document.get("local_field")
    if not field:
        return "The global model stands alone, without a local residual field."
    return f"The local residual field was {'accepted' if field.get('accepted') else 'not accepted'}."


def _checked(document: Document) -> str:
    validation = document.get("validation")
    if not validation:
        return "No targets were held out."
    if validation.get("p") is None:
        return "Targets were held out; their errors were not tested."
    agree = "agree" if validation["p"] >= alpha(document) else "do not agree"
    return f"The errors of held-out targets {agree} with their predicted σ ({chance(validation['p'])})."


def _glance(document: Document) -> list[tuple[object, object]]:
    result = document["result"]
    rows: list[tuple[object, object]] = [
        ("Standard deviation of unit weight σ₀", significant(result.get("sigma0"))),
        *_expected(document),
        ("σ of an image coordinate of mean weight", f"{significant(result.get('sigma0_px'))} px"),
        ("Degrees of freedom", count(result.get("freedom"))),
        ("Image points / targets", f"{count(result.get('image_points'))} / {count(result.get('targets'))}"),
        ("Steps to convergence", count(result.get("steps"))),
    ]
    if rmse := (document.get("validation") or {}).get("rmse_mm"):
        shown = " / ".join(fixed(rmse.get(axis), 4) for axis in ("x", "y", "z", "xyz"))
        rows.append(("RMSE of held-out targets X / Y / Z / XYZ", f"{shown} mm"))
    return rows


def _expected(document: Document) -> list[tuple[object, object]]:
    """Where σ₀ should lie if the given σ are true; σ₀ is then normal about 1 with variance 1/2r, nearly."""
    freedom = document["result"].get("freedom")
    if not freedom or (document.get("settings") or {}).get("weights") != "honest":
        return []
    reach = 1.96 / (2 * freedom) ** 0.5
    return [
        ("Expected of σ₀, were the given σ true (95 %)", f"{fixed(1 - reach, 2)} to {fixed(1 + reach, 2)}")
    ]


def _warnings(document: Document) -> Html:
    warnings = document.get("warnings")
    if not warnings:
        return element("section", paragraph("There are no warnings."), class_="box", aria_label="Warnings")
    return element(
        "section",
        element("h2", "Warnings"),
        items(spelled(warning) for warning in warnings),
        class_="box warned",
        aria_label="Warnings",
    )
