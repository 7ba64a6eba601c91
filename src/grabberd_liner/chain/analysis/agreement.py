"""Agreement of the map with another method, in one state of the wall: the input `agreement`, and its result.

table: "along_mm,round_deg,pressure_kpa,sigma_kpa…"   the text of its table, see `other_method`
state: greatest                     or {phase: 0.7}, or {field: 40}: greatest mean pressure, phase or field
above: liner                        or atmosphere: what its pressures are counted from, unless the table says
along: estimated                    or {x_mm: 15, sigma_mm: 0.5}: x of its origin in the object's frame
round: estimated                    or {deg: 0, sigma_deg: 2}: angle of its origin, 0 towards the cameras
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from grabberd.core.geometry import Reading
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.agreement import Agreement, agreement
from grabberd_liner.analysis.estimate import Estimate, Joint
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.pressure import ChamberVacuum, PressureMap, PressureModel
from grabberd_liner.analysis.other_method import ABOVE, Offsets, Overlay, Record, overlay, read_record
from grabberd_liner.analysis.surface.fitting import possible

KEYS = ("table", "state", "above", "along", "round")
GREATEST, ESTIMATED = "greatest", "estimated"
_HERE = "agreement."
_NONE = np.empty(0)
_NO_RECORD = Record(_NONE, _NONE, _NONE, _NONE, _NONE, ABOVE[0])


class OtherMethod(NamedTuple):
    """Pressures that another method measured, and the state of the wall that they are of.

    Attributes:
        record: its pressures; `offsets`: where its places begin.
        kind: `GREATEST`, `phase` or `field`, with its value.
    """

    record: Record
    offsets: Offsets
    kind: str
    value: float


def read_other_method(reading: Reading, given: object) -> OtherMethod | None:
    """The input `agreement`; None without one. What is wrong is added to the problems of the reading."""
    if given is None:
        return None
    if not isinstance(given, Mapping):
        reading.refuse("agreement", given, f"a mapping of {', '.join(KEYS)}")
        return None
    reading.keys(_HERE, given, KEYS)
    offsets = Offsets(_offset(reading, given, "along", "x_mm"), _offset(reading, given, "round", "deg"))
    return OtherMethod(_record(reading, given), offsets, *_state(reading, given.get("state")))


def _record(reading: Reading, given: Mapping[str, object]) -> Record:
    text = reading.text(given, "table", _HERE)
    if not text:
        return _NO_RECORD
    try:
        record = read_record(text)
    except InputError as error:
        reading.problems.append(f"agreement.table: {error.message}: {error.hint}")
        return _NO_RECORD
    above = given.get("above", record.above)
    if above not in ABOVE or (record.above and above != record.above):
        stated = f"{' or '.join(ABOVE)}, what its pressures are counted from"
        said = f"; the table says {record.above}" if record.above else ""
        reading.refuse("agreement.above", given.get("above"), stated + said)
    return record._replace(above=str(above))


def _offset(reading: Reading, given: Mapping[str, object], key: str, value: str) -> Estimate | None:
    """An offset that is given; None if it is to be estimated."""
    stated = given.get(key, ESTIMATED)
    if stated == ESTIMATED:
        return None
    sigma = f"sigma_{value.removeprefix('x_')}"
    if not isinstance(stated, Mapping):
        reading.refuse(f"{_HERE}{key}", stated, f"{ESTIMATED}, or a mapping of {value} and {sigma}")
        return None
    where = f"{_HERE}{key}."
    reading.keys(where, stated, (value, sigma))
    return Estimate.of(reading.number(stated, value, where), abs(reading.number(stated, sigma, where)))


def _state(reading: Reading, value: object) -> tuple[str, float]:
    if value == GREATEST:
        return GREATEST, 0.0
    if isinstance(value, Mapping) and len(value) == 1:
        if "field" in value:
            return "field", reading.integer(value, "field", "agreement.state.", least=0)
        if "phase" in value:
            return "phase", reading.number(value, "phase", "agreement.state.") % 1
    reading.refuse("agreement.state", value, f"{GREATEST}, {{phase: 0…1}} or {{field: n}}")
    return GREATEST, 0.0


class Candidate(NamedTuple):
    """A state of the wall that may be compared: of a `field` or a `phase`, with its number or value."""

    kind: str
    value: float
    points: Points
    vacuum: ChamberVacuum
    pressure: PressureMap | None


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """Result of a comparison.

    Attributes:
        state: in words.
        other: the other method.
        overlay: map and record at the same places; None with a reason.
        agreement: what their differences say; None with a reason.
        reason: why there is none; empty if there is one.
    """

    state: str
    other: OtherMethod
    overlay: Overlay | None = None
    agreement: Agreement | None = None
    reason: str = ""


def compared(
    other: OtherMethod, model: PressureModel | None, grid: Grid, candidates: Sequence[Candidate]
) -> Compared:
    """Compare the map of one state with another method.

    Args:
        other: the other method.
        model: of the pressure; None if an input for it is missing.
        grid: targets of the object model.
        candidates: states of the wall.
    """
    state = GREATEST
    try:
        if model is None:
            raise AnalysisError("the analysis has no pressure", "give the inputs that it lacks")
        chosen = _chosen(other, candidates)
        state = f"{chosen.kind} {chosen.value:.4g}"
        laid = _laid(other, model, grid, chosen)
        found = agreement(laid.difference_kpa, laid.map_kpa, laid.other_kpa, laid.chi2, laid.dof)
    except AnalysisError as error:
        return Compared(state, other, reason=f"{error.message}; {error.hint}")
    return Compared(state, other, laid, found)


def _laid(other: OtherMethod, model: PressureModel, grid: Grid, chosen: Candidate) -> Overlay:
    if chosen.pressure is None:
        raise AnalysisError("the wall has no equilibrium in that state", "choose another state")
    kept, _ = possible(grid, chosen.points)
    teat = model.over_teat(model.settled(kept, chosen.vacuum, exact=True), chosen.pressure)
    if other.record.above == "atmosphere":
        value, covariance = teat.contact_kpa
        vacuum = chosen.vacuum
        teat = replace(
            teat, contact_kpa=Joint(value - vacuum.liner_kpa, covariance + vacuum.liner_sigma_kpa**2)
        )
    return overlay(teat, other.record, other.offsets)


def _chosen(other: OtherMethod, candidates: Sequence[Candidate]) -> Candidate:
    phases = [one for one in candidates if one.kind == "phase"]
    if other.kind == GREATEST:
        known = [
            one for one in phases or candidates if one.pressure and np.isfinite(one.pressure.mean_kpa.value)
        ]
        if known:
            return max(known, key=lambda one: float(one.pressure.mean_kpa.value) if one.pressure else 0.0)
    elif other.kind == "phase" and phases:
        # Phases are cyclic: 0.95 and 0.05 are 0.1 apart.
        return min(phases, key=lambda one: abs((one.value - other.value + 0.5) % 1 - 0.5))
    else:
        for one in candidates:
            if (one.kind, one.value) == (other.kind, other.value):
                return one
    raise AnalysisError(
        f"there is no {other.kind} {other.value:g} with a pressure"
        if other.kind != GREATEST
        else "no state has a pressure",
        "choose one of the states that the analysis has",
    )


def agreement_values(found: Compared | None) -> dict[str, Any]:
    """Values of the table `agreement` by column name: one row, or none without another method."""
    rows = 0 if found is None else 1
    result, laid = (None, None) if found is None else (found.agreement, found.overlay)

    def number(value: float | None) -> Any:
        return np.full(rows, np.nan if value is None else value)

    def measured(value: Estimate | None) -> Estimate:
        return Estimate(number(value and float(value.value)), number(value and float(value.sigma)))

    def text(words: str) -> Any:
        return np.full(rows, words, object)

    limits = {
        f"{side}_{name}kpa": number(getattr(getattr(result, side, None), part, None))
        for side in ("lower", "upper")
        for name, part in (("", "value"), ("low_", "low"), ("high_", "high"))
    }
    names = ("bias_low", "bias_high", "sd", "expected_sd")
    return {
        "state": text(found.state if found else ""),
        "above": text(found.other.record.above if found else ""),
        "places": number(result and result.places),
        "outside": number(laid and int((~laid.inside).sum())),
        "origin_x_mm": measured(laid and laid.offsets[0]),
        "origin_round_deg": measured(laid and laid.offsets[1]),
        "estimated": text(", ".join(("along", "round")[k] for k in laid.estimated) if laid else ""),
        "bias_kpa": measured(result and result.bias),
        **{f"{name}_kpa": number(getattr(result, name, None)) for name in names},
        **limits,
        "independent": number(result and result.independent),
        "slope": measured(result and result.slope),
        **{name: number(getattr(result, name, None)) for name in ("chi2", "dof", "p")},
        "reason": text(found.reason if found else ""),
    }


def place_values(found: Compared | None) -> dict[str, Any]:
    """Values of the table `agreement_places` by column name."""
    if found is None or found.overlay is None:
        none = np.empty(0)
        pressures = ("map_kpa", "other_kpa", "difference_kpa")
        return {"x_mm": none, "round_deg": none, **dict.fromkeys(pressures, Estimate(none, none))}
    laid = found.overlay
    return {
        "x_mm": laid.x_mm,
        "round_deg": laid.round_deg,
        "map_kpa": laid.map_kpa.estimate,
        "other_kpa": laid.other_kpa,
        "difference_kpa": laid.difference_kpa.estimate,
    }
