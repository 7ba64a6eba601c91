"""The test of the liner at milking: its load on the teat, its times, the pulsator."""

import math
from collections.abc import Iterator

import numpy as np

from grabberd_liner.analysis.load.load_fit import MISFIT_ALARM
from grabberd_liner.chain.guided_tests.outcome import (
    FAILED,
    LINE,
    NOT_CERTAIN,
    NOT_CHECKED,
    PASSED,
    Check,
    Curve,
    Evidence,
    Offer,
    Outcome,
    Question,
    exact,
    findings_of,
)

_LEAST_CYCLES = 5.0
_LEAST_COLUMNS = 4
_CLOCK_KPA = 2.5
"""What the clocks' σ may do to the vacuum on its steepest flank: 8 ms at 300 kPa/s."""
_OVERPRESSURES = ("overpressure_derived_kpa", "overpressure_raised_kpa", "overpressure_map_kpa")
_NAMES = (
    "liner_compression_mean_kpa",
    "liner_compression_greatest_kpa",
    "liner_compression_teat_end_kpa",
    "liner_compression_mean_above_atmosphere_kpa",
    "liner_compression_greatest_above_atmosphere_kpa",
    "liner_compression_teat_end_above_atmosphere_kpa",
    "teat_end_beyond_flow_stop_kpa",
    *_OVERPRESSURES,
    "overpressure_disagreement_kpa",
    "teat_load_peak_n_per_mm",
    "teat_load_n",
    "massage_time_s",
    "stroke_mm",
    "liner_opening_s",
    "liner_closing_s",
    "liner_opening_1mm_s",
    "liner_closing_1mm_s",
    "rate_per_min",
    "wall_ratio",
    "phase_b_share",
    "phase_d_share",
    "phase_d_s",
    "opening_lag_s",
    "closing_lag_s",
)
_VERDICTS = {"met": PASSED, "not met": FAILED, "not certain": NOT_CERTAIN}
_LOGGER = "record the capture with the logger running (docs/howto/loggers.md)"

CYCLES = Question("cycles", "enough cycles", "capture for longer, while the pulsator runs", "")
LOAD = Question(
    "load_known",
    "pressure on the teat was found",
    "give the liner's profile a material, its ends, a reference state and sought_kpa, and record the vacuum",
)
TEAT_END = Question(
    "teat_end_seen",
    "teat's end is seen",
    "glue targets farther down, to where opposite walls meet below the teat; push the cup on as far",
)
OVERPRESSURE = Question(
    "overpressure_known",
    "overpressure was found",
    "record milk flow and state milk_flow in the cup's profile, or flow_stop in the cow's; label them",
)
TIMES = Question(
    "times_known",
    "opening and closing times were found",
    "capture for longer, while the pulsator runs evenly",
)
MISFIT = Question(
    "misfit",
    "points agree with the wall",
    "check the liner's label; make a ramp, and accept its offer; check vacuum and clock",
    "1",
)
COLUMNS = Question(
    "columns_seen", "both views see enough columns", "turn the cup until both views see the same four columns"
)
CLOCK = Question(
    "clock", "vacuum and picture go by one clock", f"{_LOGGER}, or wire a light into the picture", "kPa"
)
_ISO_REMEDY = "have the pulsator tested and set; look for a kinked or leaking pulse tube"
ISO = {
    "phase_b_share": Question("phase_b", "phase b by ISO 5707", _ISO_REMEDY, "1"),
    "phase_d_share": Question("phase_d", "phase d by ISO 5707", _ISO_REMEDY, "1"),
    "phase_d_s": Question("phase_d_time", "duration of phase d by ISO 5707", _ISO_REMEDY, "s"),
}
_LEAST = {"phase_b_share": "at least 0.30", "phase_d_share": "at least 0.15", "phase_d_s": "at least 0.150 s"}


def milking_test(one: Evidence) -> Outcome:
    """Judges a capture of a milking."""
    if one.analysis is None:
        asked = (CYCLES, COLUMNS, LOAD, TEAT_END, OVERPRESSURE, TIMES, *ISO.values(), MISFIT, CLOCK)
        return Outcome(tuple(ask.not_checked("the capture was not analysed") for ask in asked))
    checks = [
        _cycles(one),
        _columns(one),
        *_known(one),
        *(_iso(one, name, ask) for name, ask in ISO.items()),
        _misfit(one),
        _clock(one),
    ]
    return Outcome(tuple(checks), findings_of(one, _NAMES), tuple(_curves(one)), _offer(one))


def _cycles(one: Evidence) -> Check:
    found = one.value("summary", "cycles")
    return CYCLES.at_least(found, _LEAST_CYCLES, "no cycle was found" if math.isnan(found.value) else "")


def _columns(one: Evidence) -> Check:
    """Columns of which most targets are seen by both views in most fields."""
    assert one.analysis is not None
    grid, fields = one.analysis.grid, one.captured
    seen = np.zeros(len(grid))
    for field in fields:
        seen[grid.indices(field.timed.points.target)] += 1
    column = grid.column
    shares = [float(np.median(seen[column == at])) / max(len(fields), 1) for at in np.unique(column)]
    often = sum(share >= 0.5 for share in shares)
    return COLUMNS.at_least(exact(often), _LEAST_COLUMNS, f"{often} of {len(shares)} columns are seen often")


def _known(one: Evidence) -> Iterator[Check]:
    for ask, name in (
        (LOAD, "liner_compression_mean_kpa"),
        (TEAT_END, "teat_end_x_mm"),
        (TIMES, "liner_closing_s"),
    ):
        yield ask.answered(one.quantity(name) is not None, one.said(name, "reason"))
    yield _overpressure(one)


def _overpressure(one: Evidence) -> Check:
    """The check that one way to it has a result, as far as any was asked for."""
    if any(one.quantity(name) for name in _OVERPRESSURES):
        return OVERPRESSURE.answered(True)
    reasons = dict.fromkeys(one.said(name, "reason") for name in _OVERPRESSURES)
    asked = [text for text in reasons if "was not given" not in text]
    if not asked:
        return OVERPRESSURE.not_checked(f"{'; '.join(reasons)}; {OVERPRESSURE.remedy}")
    return OVERPRESSURE.answered(False, "; ".join(asked))


def _iso(one: Evidence, name: str, ask: Question) -> Check:
    found, verdict = one.quantity(name), one.said(name, "verdict")
    if found is None:
        return ask.not_checked(f"{one.said(name, 'reason')}; {_LOGGER}")
    judged, passed = _VERDICTS.get(verdict, NOT_CHECKED), verdict == "met"
    return Check(
        ask.name,
        ask.title,
        judged,
        float(found.value),
        float(found.sigma),
        ask.unit,
        _LEAST[name],
        "" if passed else f"the limit is {verdict}",
        "" if passed else ask.remedy,
    )


def _misfit(one: Evidence) -> Check:
    misfit = one.tables["phases"].column("load_misfit")
    if not np.isfinite(misfit).any():
        return MISFIT.not_checked(one.no_pressure)
    return MISFIT.at_most(exact(float(np.nanmedian(misfit))), MISFIT_ALARM)


def _clock(one: Evidence) -> Check:
    found = float(one.value("summary", "clock_kpa").value)
    if math.isnan(found):
        return CLOCK.not_checked("the vacuum is not known as a curve with a clock of its own")
    return CLOCK.at_most(exact(found), _CLOCK_KPA)


def _offer(one: Evidence) -> Offer | None:
    """The liner's profile with the lag of the wall, if it has none and this capture tells it."""
    liner, opening, closing = one.liner, one.quantity("opening_lag_s"), one.quantity("closing_lag_s")
    if liner is None or liner.content.get("lag") is not None or opening is None or closing is None:
        return None
    lag = {
        "opening_s": round(float(opening.value), 5),
        "closing_s": round(float(closing.value), 5),
        "sigma_s": round(max(float(opening.sigma), float(closing.sigma)), 5),
    }
    return Offer({**liner.content, "lag": lag}, liner.version)


def _curves(one: Evidence) -> Iterator[Curve]:
    profile, phases = one.tables["phase_profile"], one.tables["phases"]
    phase, load = profile.column("phase"), profile.column("load_n_per_mm")
    known = [at for at in np.unique(phase) if np.isfinite(load[phase == at]).any()]
    if known:
        fullest = phase == max(known, key=lambda at: float(np.nansum(load[phase == at])))
        x, y, sigma = (
            profile.column(name)[fullest] for name in ("x_mm", "compression_kpa", "sigma_compression_kpa")
        )
        axes = (("height on the liner", "mm"), ("compression at full closure", "kPa"))
        yield Curve("compression", "liner compression", axes, LINE, x, y, sigma)
    axes = (("phase of the mean cycle", "1"), ("pressure", "kPa"))
    for name, title in (
        ("mean_contact_kpa", "mean pressure on the teat"),
        ("pulsation_vacuum_kpa", "vacuum in the pulsation chamber"),
    ):
        y, sigma = phases.column(name), phases.column(f"sigma_{name}")
        if np.isfinite(y).any():
            yield Curve(name, title, axes, LINE, phases.column("phase"), y, sigma)
