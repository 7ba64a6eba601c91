"""Closures of one field to eight, found, measured and smoothed, beside the simulator's truth, in a table."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from tests.core.chain.closures import Closure, Film

from grabberd.core.chain.accuracy import Compared, Investigation

SECONDS = (0.02, 0.04, 0.09, 0.15)
STROKES_MM = (5.0, 7.5, 10.0)
SEEDS = range(20)
"""None of those that tracker and smoother were tuned with (1000 and up, at 8 and 10 mm)."""
EXPOSURES_MS = (1.0, 4.0)
LOST = (0.05, 0.30)
WAYS = (("1 bit, doubled", 1), ("8 bit, 288 lines", 8))


class Row(NamedTuple):
    """All seeds of one closure, seen one way."""

    name: str
    results: list[Investigation]

    def __str__(self) -> str:
        tables = [one.single.accuracy for one in self.results]
        matched, missing, wrong = (
            sum(getattr(one, name) for one in tables) for name in ("matched", "missing", "wrong")
        )
        single, smoothed = ([getattr(one, name) for one in self.results] for name in ("single", "smoothed"))
        worse = sum(after > before for before, after in zip(_rmse(single), _rmse(smoothed), strict=True))
        found = 100.0 * matched / (matched + missing + wrong)
        return (
            f"| {self.name} | {found:.3f} % | {wrong} | {_overall(single)} | {_overall(smoothed)} "
            f"| {worse} of {len(self.results)} |"
        )


def table(reflections: int) -> str:
    """Found, wrong, and the error of single fields and smoothed ones, by closing time, stroke and bits."""
    about = (
        f"{len(SEEDS)} seeds each: rig, noise, law of time, shape (the ellipse and solved walls), when it "
        f"closes, exposure 1 or 4 ms; 2.5 s each, ideal mirrors ({reflections} a view), the exact "
        "calibration. Lost: 5 to 30 % of the fields, by seed. RMSE in mm (χ², mean over the seeds)."
    )
    columns = "found of what both views see", "wrong", "single fields", "smoothed", "worse"
    head = f"| closes in, stroke, field | {' | '.join(columns)} |"
    closures = ((seconds, stroke_mm) for seconds in SECONDS for stroke_mm in STROKES_MM)
    rows = [str(row) for closure in closures for row in _rows(*closure, reflections)]
    return "\n".join([f"{about}\n", head, "|---|---|---|---|---|---|", *rows])


def _rows(seconds: float, stroke_mm: float, reflections: int) -> Iterator[Row]:
    films = [
        Film(Closure(seconds, stroke_mm, seed, EXPOSURES_MS[seed // 4 % 2], reflections=reflections))
        for seed in SEEDS
    ]
    lost = np.linspace(*LOST, len(SEEDS)).tolist()
    for name, bits in WAYS:
        where = f"{1000 * seconds:.0f} ms, {stroke_mm:g} mm, {name}"
        yield Row(where, [film.investigated(bits) for film in films])
        yield Row(
            f"{where}, fields lost",
            [film.investigated(bits, share) for film, share in zip(films, lost, strict=True)],
        )


def _rmse(compared: list[Compared]) -> list[float]:
    return [one.accuracy.rmse.xyz_mm for one in compared]


def _overall(compared: list[Compared]) -> str:
    rmse = float(np.sqrt(np.mean(np.square(_rmse(compared)))))
    return f"{rmse:.4f} ({np.mean([one.chi2 for one in compared]):.2f})"
