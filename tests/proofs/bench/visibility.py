"""Closing walls of six to nine columns by another renderer: what both views show, and what is found of it."""

from collections.abc import Iterator
from dataclasses import replace

from tests.proofs.visibility.closing_wall import Closing
from tests.proofs.visibility.judging import (
    LEAST_ACROSS_PX,
    LEAST_UNCOVERED,
    MOST_TILT_DEG,
    WRONG_MM,
    WRONG_SIGMA,
    Film,
    Judged,
)

COLUMNS = (6, 7, 8, 9)
SHAPES = {
    "flattens toward the cameras, 8 mm": {"stroke_mm": 8.0},
    "with a waist, 6 mm": {"stroke_mm": 6.0, "waist": 0.235},
    "flattens at 45°, 6 mm": {"stroke_mm": 6.0, "turned_deg": 45.0},
    "at 60° with a waist, 5 mm": {"stroke_mm": 5.0, "turned_deg": 60.0, "waist": 0.2},
    "flattens sideways, 5 mm": {"stroke_mm": 5.0, "turned_deg": 90.0},
}
SECONDS = (0.02, 0.09, 0.15)
SEED = 7000
"""From here on: no constant was chosen with these."""
BITS = {8: "8 bit, 288 lines", 1: "1 bit, doubled"}


def table() -> str:
    """What is found of what both views show, by the wall's shape, its columns, and its time of closing."""
    about = (
        "The discs lie on the wall, which hides its own far side; OpenCV's cameras, in every other scene "
        "behind one mirror each, spread .75 px, exposure 1 or 4 ms, noise 2 %, line jitter .12 px, the exact "
        "calibration, 9 rows, 30 fields each. Visible: turned from both views by at most "
        f"{MOST_TILT_DEG:.0f}°, {100 * LEAST_UNCOVERED:.0f} % uncovered; of these wide: "
        f"{LEAST_ACROSS_PX:.0f} px or more across in both. Wrong: the image of another disc, or off by more "
        f"than {WRONG_MM} mm and {WRONG_SIGMA:.0f} σ. Points: those of more oblique discs included."
    )
    names = (
        "found of what is visible",
        "missing",
        "of wide ones",
        "merged",
        "points",
        "wrong",
        "χ²",
        "worst, mm",
    )
    head = f"| wall, closing time, field | {' | '.join(names)} |"
    return "\n".join([f"{about}\n", head, "|---" * (len(names) + 1) + "|", *_rows()])


def _rows() -> Iterator[str]:
    everything: dict[int, list[Judged]] = {bits: [] for bits in BITS}
    for where, films in _films():
        for bits, kind in BITS.items():
            judged = [film.judged(bits) for film in films]
            everything[bits] += judged
            yield _row(f"{where}, {kind}", Judged.sum_of(judged))
    for bits, kind in BITS.items():
        yield _row(f"all, {kind}", Judged.sum_of(everything[bits]))


def _films() -> Iterator[tuple[str, list[Film]]]:
    for at, (name, shape) in enumerate(SHAPES.items()):
        seeds = {columns: SEED + 10 * columns + at for columns in COLUMNS}
        yield (
            f"{name}, 35 ms",
            [_film(Closing(columns, 0.035, seed, **shape)) for columns, seed in seeds.items()],
        )
    for at, seconds in enumerate(SECONDS):
        seeds = {columns: SEED + 100 + 10 * columns + at for columns in (7, 9)}
        scenes = [Closing(columns, seconds, seed) for columns, seed in seeds.items()]
        yield (
            f"flattens toward the cameras, 8 mm, {1000 * seconds:.0f} ms",
            [_film(scene) for scene in scenes],
        )


def _film(scene: Closing) -> Film:
    return Film(replace(scene, exposure_ms=4.0 if scene.seed // 2 % 2 else 1.0))


def _row(name: str, one: Judged) -> str:
    numbers = (
        f"{100 * one.share:.3f} %",
        f"{one.missing} of {one.visible}",
        f"{one.missing_wide} of {one.wide}",
        one.merged,
        one.points,
        one.wrong,
        f"{one.chi2:.2f}",
        f"{one.worst_mm:.2f}",
    )
    return f"| {name} | {' | '.join(map(str, numbers))} |"
