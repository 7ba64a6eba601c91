"""How far a closed liner's pressure and its sums are off, on walls drawn at random and solved as solids.

`python -m tests.proofs.bench.load_accuracy --tuning` or `--held-out`. Walls that are
not kept in `build` are solved first. `--glued FILE` writes what more columns or rows of targets give, the
table from which `grabberd plan` and the analysis report take it.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.liner.analysis.walls import EIGHT_BITS_MM, ONE_BIT_MM, PITCH_MM, SolvedLiner, with_noise
from tests.proofs.bench.load_walls import HELD_OUT, SEEDS, TUNING, Wall, walls
from tests.proofs.bench.pressure_case import REFERENCE_MM, SOUGHT_KPA, Figures, Given, paragraph

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.liner_compression import AT_END_SHARE, COMPRESSION_SHARE
from grabberd_liner.analysis.load.load_profile import TEAT_END_MM, LoadProfile
from grabberd_liner.analysis.load.pressure import PressureMap, PressureModel

Array = NDArray[np.float64]

PLACE, MEAN, COMPRESSION, END, LOAD, FORCE = "place", "mean", "compression", "at the end", "load", "force"
UNITS = {PLACE: "kPa", MEAN: "kPa", COMPRESSION: "kPa", END: "kPa", LOAD: "N/m", FORCE: "N"}
COLUMNS, NOISE_MM = (4, 6), {8: EIGHT_BITS_MM, 1: ONE_BIT_MM}
GRIDS = ((4, 2 * PITCH_MM), (4, PITCH_MM), (6, 2 * PITCH_MM), (6, PITCH_MM))
"""Columns of targets, and pitch of the rows in mm, for the advice on glueing them."""
PHASE_FIELDS = 10
"""Of whose points a phase is the mean."""
SECTION, SOLID = "section", "solid"
"""In plane strain, and in three dimensions."""
Way = tuple[int, int]
"""Bits, and fields averaged."""
WAYS: tuple[Way, ...] = ((8, 1), (1, 1), (8, PHASE_FIELDS))
FIRST = WAYS[:1]
GLUED_HEADER = "columns,row_pitch_mm,walls,mean_kpa,compression_kpa,load_percent"
_WITHIN = np.linspace(-0.4, 0.4, 5)
"""Of an element's length: where an estimate is averaged over it."""


class Judged(NamedTuple):
    """One map beside the truth.

    Attributes:
        wall, columns, bits: what was seen; `fields`: of whose points it is the mean.
        pairs: estimate less truth and σ by name of the quantity; empty if the map was refused.
        true: what is true, by name.
    """

    wall: Wall
    columns: int
    bits: int
    fields: int
    pairs: dict[str, tuple[Array, Array]]
    true: dict[str, Array]


def judged(of: str, ways: Sequence[Way]) -> list[Judged]:
    """All maps of a set."""
    found = []
    for number, wall in enumerate(walls(of)):
        for columns in COLUMNS:
            random = np.random.default_rng([SEEDS[of], number, columns])
            found += list(of_wall(wall, columns, random, ways))
    return found


def of_wall(
    wall: Wall,
    columns: int,
    random: np.random.Generator,
    ways: Sequence[Way] = FIRST,
    row_pitch_mm: float = PITCH_MM,
) -> Iterator[Judged]:
    """All maps of a wall, by an estimator that is told its values with one draw of their errors."""
    half_mm = wall.length_mm / 2
    liner, given = SolvedLiner(wall.states.name, columns, wall.states, row_pitch_mm), Given.drawn(random)
    zones = liner.zones(first_end_mm=-half_mm, last_end_mm=half_mm, **given.material(liner))
    reference = with_noise(liner, liner.places_mm(0.0), REFERENCE_MM, random)
    model = PressureModel(liner.grid, zones, reference, SOUGHT_KPA)
    vacuum = given.vacuum(wall.outer_kpa)
    true = _true(wall, liner)
    for bits, fields in ways:
        deviation = NOISE_MM[bits] / np.sqrt(fields)
        points = with_noise(liner, liner.places_mm(wall.outer_kpa), deviation, random)
        try:
            settled = model.settled(points, vacuum, exact=fields > 1)
            one = model.of_settled(settled, np.ones(len(liner.grid), bool), vacuum)
            pairs = dict(_pairs(one, true, wall, liner)) if one.usable.any() and one.profile else {}
        except AnalysisError:
            pairs = {}
        yield Judged(wall, columns, bits, fields, pairs, true)


def _true(wall: Wall, liner: SolvedLiner) -> dict[str, Array]:
    """What is true: at the inner columns' targets, of all targets, of rows on the teat, of elements there."""
    contact = liner.contact_kpa(wall.outer_kpa)
    force = liner.states.force_n_per_mm(wall.outer_kpa)
    elements_mm = liner.states.x_mm[1::2]
    return {PLACE: contact[liner.inner], MEAN: contact, LOAD: force, "x": elements_mm}


def _pairs(
    one: PressureMap, true: dict[str, Array], wall: Wall, liner: SolvedLiner
) -> Iterator[tuple[str, tuple[Array, Array]]]:
    profile = one.profile
    assert profile is not None
    value, sigma = one.contact_kpa
    yield PLACE, (value[liner.inner] - true[PLACE], sigma[liner.inner])
    yield MEAN, (np.array([float(one.mean_kpa.value) - true[MEAN].mean()]), one.mean_kpa.sigma.reshape(1))
    end_mm = min(_mounted_end_mm(wall, liner), float(profile.x_mm[-1]))
    first_mm = float(profile.x_mm[0])
    reach_mm = min(10.0, float(np.abs(liner.theta).max()) * liner.design["radius_mm"])
    compression = _arc_means_kpa(liner, wall.outer_kpa, profile.x_mm, reach_mm / liner.design["radius_mm"])
    stretches = ((COMPRESSION, first_mm), (END, end_mm - TEAT_END_MM))
    for name, from_mm in stretches[: 1 if wall.plane else 2]:
        over = profile.spans_within(from_mm, end_mm)
        weights = over / over.sum()
        found = profile.compression_kpa.summed(weights)
        share = COMPRESSION_SHARE if name == COMPRESSION else AT_END_SHARE
        sigma = np.hypot(found.sigma, share * found.value)
        yield name, (np.array([float(found.value) - weights @ compression]), sigma.reshape(1))
    yield from _loads(profile, true, first_mm, end_mm)


def _loads(
    profile: LoadProfile, true: dict[str, Array], first_mm: float, end_mm: float
) -> Iterator[tuple[str, tuple[Array, Array]]]:
    load = profile.load_n_per_mm
    pitch_mm = 6.5
    centres = np.arange(first_mm + pitch_mm / 2, end_mm - pitch_mm / 2 + 1e-6, pitch_mm)
    if len(true["x"]) > 1:
        inside = (true["x"] > first_mm + pitch_mm / 2) & (true["x"] < end_mm - pitch_mm / 2)
        centres = true["x"][inside]
    weights = np.stack([_weights(profile.x_mm, x + _WITHIN * pitch_mm) for x in centres])
    truth = np.interp(centres, true["x"], true[LOAD])
    found = load.summed(weights)
    true["on teat"] = 1000 * truth
    yield LOAD, (1000 * (found.value - truth), 1000 * found.sigma)
    whole = weights.sum(axis=0) * pitch_mm * profile.length
    total = load.summed(whole)
    lengths = pitch_mm * np.interp(centres, profile.x_mm, profile.length)
    true["total"] = np.array([truth @ lengths])
    yield FORCE, (np.array([float(total.value) - truth @ lengths]), total.sigma.reshape(1))


def _weights(x_mm: Array, at_mm: Array) -> Array:
    """(H,) weights of linear interpolation among heights, mean over places."""
    hats = [np.interp(at_mm, x_mm, row) for row in np.eye(len(x_mm))]
    return np.mean(hats, axis=1)


def _mounted_end_mm(wall: Wall, liner: SolvedLiner) -> float:
    """Place on the mounted tube of what is at the teat's end now."""
    now = liner.states.outer_mm(wall.outer_kpa)[:, 0, 0]
    return float(np.interp(wall.states.about["teat"]["end_x_mm"], now, liner.states.x_mm))


def _arc_means_kpa(liner: SolvedLiner, outer_kpa: float, x_mm: Array, reach: float) -> Array:
    """(H,) mean contact pressure over an arc of the wall."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    return liner.values_kpa(outer_kpa, x_mm, reach * nodes) @ weights / 2


def table(of: str = HELD_OUT, ways: Sequence[Way] = WAYS) -> str:
    """Markdown."""
    found = judged(of, ways)
    heads = ("wall", "columns", "bits", "fields", *(f"{name}, {unit}" for name, unit in UNITS.items()))
    lines = [_introduction(of, found), "", f"| {' | '.join([*heads, 'load, %', 'answered'])} |"]
    lines.append("|" + "---|" * (len(heads) + 2))
    for columns in COLUMNS:
        for bits, fields in ways:
            for kind in (SECTION, SOLID, ""):
                lines.append(_row(found, kind, columns, bits, fields))
    lines += ["", "One field of 8 bit each, by the wall, its law and its teat.", "", *_each(found)]
    return "\n".join(lines)


def _introduction(of: str, found: Sequence[Judged]) -> str:
    count = len({one.wall.states.name for one in found})
    return paragraph(
        f"{count} walls of the set {of}, each closed on a teat by 26 to 42 kPa: `{SOLID}` in three",
        f"dimensions, `{SECTION}` in plane strain. Modulus, thickness, pretension and pressure difference",
        "that the estimator is told err by their σ: 3.5 %, 2 %, 10 %, .5 kPa. RMS / σ (χ²),",
        "mean error, of contact pressure at inner columns' targets and of its mean over all, compression",
        "on the teat and over its",
        f"last {TEAT_END_MM:g} mm, load per height on the teat (in % of the true one's RMS) and its sum.",
    )


def _row(found: Sequence[Judged], kind: str, columns: int, bits: int, fields: int) -> str:
    some = [one for one in found if (one.columns, one.bits, one.fields) == (columns, bits, fields)]
    some = [one for one in some if not kind or one.wall.plane == (kind == SECTION)]
    answered = f"{100 * np.mean([bool(one.pairs) for one in some]):.0f} %"
    cells = [kind or "both", str(columns), str(bits), str(fields), *_figures(some), answered]
    return f"| {' | '.join(cells)} |"


def _figures(some: Sequence[Judged]) -> list[str]:
    kept = [one for one in some if one.pairs]
    cells = []
    for name in UNITS:
        pairs = [one.pairs[name] for one in kept if name in one.pairs]
        pooled = [np.concatenate(parts) for parts in zip(*pairs, strict=True)] if pairs else [np.empty(0)] * 2
        cells.append(_text(Figures.of(*pooled), name))
    share = _load_share(kept)
    return [*cells, f"{100 * share:.0f}" if kept else "none"]


def _load_share(kept: Sequence[Judged]) -> float:
    """RMS error of the load per height, as a share of the true one's RMS; NaN without any map."""
    if not kept:
        return float("nan")
    errors = np.concatenate([one.pairs[LOAD][0] for one in kept])
    true = np.concatenate([one.true["on teat"] for one in kept])
    return float(np.sqrt(np.mean(errors**2) / np.mean(true**2)))


def write_glued(path: Path, of: str = HELD_OUT) -> None:
    """Writes the errors by `GRIDS`, a row for each, into the table of the advice on glueing targets."""
    kept = list(walls(of))
    rows = [glued_row(kept, SEEDS[of], columns, pitch_mm) for columns, pitch_mm in GRIDS]
    path.write_text("\n".join([GLUED_HEADER, *rows]) + "\n")


def glued_row(some: Sequence[Wall], seed: int, columns: int, row_pitch_mm: float) -> str:
    """CSV row: RMS errors over walls with so many columns of targets, and rows so far apart."""
    found = [
        one
        for number, wall in enumerate(some)
        for one in of_wall(wall, columns, np.random.default_rng([seed, number, columns]), FIRST, row_pitch_mm)
        if one.pairs
    ]
    rms = [
        np.sqrt(np.mean(np.concatenate([one.pairs[name][0] for one in found]) ** 2))
        for name in (MEAN, COMPRESSION)
    ]
    errors = ",".join(f"{one:.2f}" for one in rms)
    return f"{columns},{row_pitch_mm:g},{len(found)},{errors},{100 * _load_share(found):.1f}"


def _text(figures: Figures, name: str) -> str:
    if not np.isfinite(figures.rms):
        return "none"
    digits = {LOAD: 0}.get(name, 2)
    rms, sigma = (f"{one:.{digits}f}" for one in (figures.rms, figures.sigma))
    return f"{rms} / {sigma} ({figures.chi2:.2f}) {figures.bias:+.{digits}f}"


def _each(found: Sequence[Judged]) -> Iterator[str]:
    of_wall = ("wall", "kPa", "stiffening", "friction", "teat, mm", "teat, MPa/mm", "columns")
    heads = (*of_wall, *UNITS, "load, %")
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    for one in found:
        if (one.bits, one.fields) == (8, 1):
            design, teat = (one.wall.states.about[name] for name in ("design", "teat"))
            values = f"{one.wall.outer_kpa:.0f} | {design['stiffening']:.1f} | {design['friction']:.1f}"
            values += f" | {teat['radius_mm']:.1f} | {teat['stiffness_mpa_per_mm']:.4f} | {one.columns}"
            yield f"| {one.wall.states.name} | {values} | {' | '.join(_figures([one]))} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    for name in (TUNING, HELD_OUT):
        parser.add_argument(f"--{name}", dest="of", action="store_const", const=name, default=HELD_OUT)
    parser.add_argument("--one-field", action="store_true", help="of 8 bit alone: a third of the time")
    parser.add_argument("--glued", type=Path, metavar="FILE", help="write the advice on glueing targets")
    given = parser.parse_args()
    if given.glued:
        write_glued(given.glued, given.of)
    else:
        print(table(given.of, FIRST if given.one_field else WAYS))
