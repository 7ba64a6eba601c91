"""The results of a study in sentences."""

from collections.abc import Mapping, Sequence
from typing import Any

from grabberd.reports.numbers import common_exponent, measured, p_value, power_of_ten, significant

Quantity = Mapping[str, Any]
"""A quantity in the document of a study."""
Result = Mapping[str, Any]
"""A mean, difference or slope: value, sigma, common, p and verdict."""

MOSTLY_COMMON = "σ is mostly common."
_MOST_PAIRS = 3
_MOSTLY = 0.5
"""Share of the variance from which on the common part is what limits a result."""


def answer(quantity: Quantity) -> str:
    """The result of comparing a quantity's groups."""
    pairs = quantity["differences"]
    if not pairs:
        return _means(quantity)
    certain = [one for one in pairs if one["verdict"] == "differ"]
    if certain:
        certain.sort(key=lambda one: -abs(one["value"]))
        told = "; ".join(_pair(quantity, one) for one in certain[:_MOST_PAIRS])
        more = f"; and {len(certain) - _MOST_PAIRS} more pairs differ" if len(certain) > _MOST_PAIRS else ""
        return f"{told}{more}.{_limit(certain)}"
    greatest = max(pairs, key=lambda one: abs(one["value"]))
    before = "At most, " if len(pairs) > 1 else ""
    if greatest["p"] is None:
        return f"{before}{_pair(quantity, greatest)}, by the captures' own σ alone."
    return f"{before}{_pair(quantity, greatest)}.{_limit([greatest])}"


def trend_answer(quantity: Quantity, per: str) -> str:
    """The result of a quantity's trend, all groups together."""
    slope = quantity["trend"]
    if slope is None:
        return "No group has captures at two different places."
    told = _value(slope, f"{_unit(quantity)} per {per}".strip())
    if slope["p"] is None:
        return f"{told}, by the captures' own σ alone."
    return f"{told}, {p_value(slope['p'])}.{_limit([slope])}"


def _means(quantity: Quantity) -> str:
    """The mean of the only group."""
    group = quantity["values"]["group"]
    counted = "one capture" if len(group) == 1 else f"mean of {len(group)} captures"
    return f"{_value(quantity['means'][0], _unit(quantity))}, {counted}."


def _pair(quantity: Quantity, one: Result) -> str:
    """Difference of two groups, as the greater above the lesser."""
    low, high = (quantity["groups"][one[key]] for key in ("first", "second"))
    if one["value"] < 0:
        low, high = high, low
    p = "" if one["p"] is None else f", {p_value(one['p'])}"
    return f"{high} is {_value({**one, 'value': abs(one['value'])}, _unit(quantity))} above {low}{p}"


def _value(one: Result, unit: str) -> str:
    value, sigma = one["value"], one["sigma"]
    if not sigma:
        return f"{significant(value)} {unit}".strip()
    exponent = common_exponent([value, sigma])
    both = "{} ± {}".format(*measured(value, sigma, exponent))
    return f"{f'({both}) × {power_of_ten(exponent)}' if exponent else both} {unit}".strip()


def _limit(results: Sequence[Result]) -> str:
    """Words for a result that the common part of σ limits; empty for others."""
    if not any(one["sigma"] and (one["common"] / one["sigma"]) ** 2 > _MOSTLY for one in results):
        return ""
    return f" {MOSTLY_COMMON}"


def _unit(quantity: Quantity) -> str:
    return "" if quantity["unit"] == "1" else str(quantity["unit"])
