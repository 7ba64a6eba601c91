"""Curvature, strain and tension of the wall in the chosen states, each with its σ."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from grabberd.reports.figures import State, maps_svg, states_of
from grabberd.reports.markup import Html, absent, figure, joined, table
from grabberd.reports.numbers import UNKNOWN, significant

Document = Mapping[str, Any]

_MAPS = (
    ("kappa1_per_m", "κ₁", "greater principal curvature"),
    ("strain1", "ε₁", "greater principal strain"),
    ("tension1_n_per_m", "T₁", "greater principal tension"),
)
_ROWS = (
    ("kappa1_per_m", "κ₁"), ("kappa2_per_m", "κ₂"), ("strain1", "ε₁"), ("strain2", "ε₂"),
    ("tension1_n_per_m", "T₁"), ("tension2_n_per_m", "T₂"), ("contact_kpa", "p_contact"),
    ("overpressure_kpa", "overpressure"),
)  # fmt: skip


def wall(document: Document) -> Html:
    """A figure for each quantity that is known, and all of them in numbers."""
    states = states_of(document)
    figures = [_drawn(states, *one) for one in _MAPS]
    return joined(*figures, _summed_up(states))


def _drawn(states: list[State], column: str, symbol: str, said: str) -> Html:
    if not any(state.columns.is_known(column) for state in states):
        return absent(f"The {said} is not known: see what was not given, above.")
    svg = maps_svg(states, column, symbol, f"Map of the {said} and of its σ")
    return figure(svg, f"Above: {said} {symbol}. Below: its σ.")


def _summed_up(states: list[State]) -> Html:
    rows = [
        (f"{state.name}: {state.columns.titled(name, symbol)}", *_spread(state, name))
        for state in states
        for name, symbol in _ROWS
        if state.columns.is_known(name)
    ]
    heads = ["State and quantity", "least", "median", "greatest", "median σ"]
    return table("The wall's state over its targets", heads, rows, class_="dense")


def _spread(state: State, name: str) -> list[str]:
    values, sigma = state.columns.numbers(name), state.columns.sigma(name)
    shown = [np.nanmin(values), np.nanmedian(values), np.nanmax(values)]
    known = np.isfinite(sigma).any()
    return [
        *(significant(float(v)) for v in shown),
        significant(float(np.nanmedian(sigma))) if known else UNKNOWN,
    ]
