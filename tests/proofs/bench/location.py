"""All locators on the same fields of the simulator, against its truth in the picture (paper 3.5)."""

import math
import time
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import BIT_DEPTHS, Field, PackedField, double_lines, quantise
from grabberd.core.measurement import (
    METHODS,
    Blobs,
    LocationSettings,
    ThresholdRule,
    choose_threshold,
    measure,
)
from grabberd.errors import InputError
from grabberd.instrument.acquisition import GRABBERS
from grabberd_fake import FakeOptions, truth_at

FIELDS = 16
NOISE, SPREAD_PX, JITTER_PX = 0.02, 0.8, 0.12
NEAR_PX = 3.0
QUIET = 0.005
MM_A_PX = 0.255
RATIOS = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0)
"""Target diameters in spread widths."""
GOOD_PX = 0.02
DIAMETERS_MM = (0.75, 1.0, 1.25, 1.5, 2.0, 2.5)

Array = NDArray[np.float64]


class Scene(NamedTuple):
    """What the simulator is asked to show."""

    jitter_px: float
    noise: float = NOISE
    diameter_mm: float = 1.5


class Variant(NamedTuple):
    """How a field is packed, and which way the shifts of its lines are treated."""

    bits: int
    doubled: bool
    line_shifts: bool

    def __str__(self) -> str:
        lines = "doubled" if self.doubled else "288 lines"
        return f"{self.bits} bit, {lines}" + (", shifts solved" if self.line_shifts else "")


class Pointing(NamedTuple):
    """Errors of all blobs in all fields: RMS, predicted σ and mean in x and y; and time a field."""

    rms_px: Array
    sigma_px: Array
    bias_px: Array
    took_us: float

    def row(self) -> str:
        """Cells of a table."""
        numbers = np.concatenate([self.rms_px, self.sigma_px, self.bias_px])
        return " | ".join(f"{number:.3f}" for number in numbers) + f" | {self.took_us:.0f}"


def table() -> str:
    """Every method that a field's bits allow; 2 % noise, spread .8 px, discs of about 6 px."""
    head = "| method | field | RMS x | RMS y | σ x | σ y | mean x | mean y | µs a field |"
    parts = []
    for jitter_px in (0.0, JITTER_PX):
        rows = [_row(method, variant, jitter_px) for method in METHODS for variant in _variants(jitter_px)]
        bound = " | ".join(f"{sigma:.3f}" for sigma in _cramer_rao_px(jitter_px))
        rows.append(f"| Cramér–Rao bound of grey values, without jitter | | | | {bound} | | | |")
        title = f"Line jitter {jitter_px:.2f} px:"
        parts.append(
            "\n".join([title, "", head, "|---|---|---|---|---|---|---|---|---|", *filter(None, rows)])
        )
    return "\n\n".join(parts)


def table_of_bits() -> str:
    """One 8-bit capture quantised anew to 1 … 8 bits: Trinder's curve, RMS in px."""
    head = "| bits | " + " | ".join(f"{method} x | {method} y" for method in METHODS) + " |"
    rule = "|---" * (1 + 2 * len(METHODS)) + "|"
    rows = []
    for bits in BIT_DEPTHS:
        found = [_pointing(method, Variant(bits, False, False), Scene(0.0)) for method in METHODS]
        cells = [" | ".join(f"{x:.3f}" for x in one.rms_px) if one else "– | –" for one in found]
        rows.append(f"| {bits} | " + " | ".join(cells) + " |")
    return "\n".join([head, rule, *rows])


def table_of_diameters() -> str:
    """As a field is located by default: 2 % noise, line jitter .12 px, spread .8 px; RMS in x / y, px."""
    variants = [Variant(1, False, True), Variant(1, True, True), Variant(8, False, True)]
    lines = ["| diameter, mm | px | 1 bit, 288 lines | 1 bit, doubled | 8 bits |", "|---|---|---|---|---|"]
    for diameter_mm in DIAMETERS_MM:
        scene = Scene(JITTER_PX, NOISE, diameter_mm)
        found = [_pointing(LocationSettings().method, variant, scene) for variant in variants]
        cells = ["{:.3f} / {:.3f}".format(*one.rms_px) if one else "–" for one in found]
        lines.append(f"| {diameter_mm:.2f} | {diameter_mm / MM_A_PX:.1f} | {' | '.join(cells)} |")
    return "\n".join(lines)


def table_of_sizes() -> str:
    """Trinder: ≤ .02 px if the target is over four spread widths; 8 bit, .5 % noise, RMS in px."""
    head = "| diameter / spread | weighted x | weighted y | template x | template y | ≤ .02 |"
    return "\n".join([head, "|---|---|---|---|---|---|", *(_size_row(ratio) for ratio in RATIOS)])


def _size_row(ratio: float) -> str:
    scene = Scene(0.0, QUIET, ratio * SPREAD_PX * MM_A_PX)
    found = {
        method: _pointing(method, Variant(8, False, False), scene) for method in ("weighted", "template")
    }
    rms = {method: one.rms_px for method, one in found.items() if one}
    good = ", ".join(method for method, one in rms.items() if one.max() <= GOOD_PX)
    numbers = " | ".join(f"{number:.3f}" for number in np.concatenate(list(rms.values())))
    return f"| {ratio:.0f} | {numbers} | {good or '–'} |"


def _variants(jitter_px: float) -> list[Variant]:
    shifts = (False, True) if jitter_px else (False,)
    return [
        Variant(bits, doubled, solved)
        for bits, doubled in ((1, False), (1, True), (8, False))
        for solved in shifts
    ]


def _row(method: str, variant: Variant, jitter_px: float) -> str | None:
    found = _pointing(method, variant, Scene(jitter_px))
    return f"| {method} | {variant} | {found.row()} |" if found else None


def _pointing(method: str, variant: Variant, scene: Scene) -> Pointing | None:
    """None where the method is not meant for so many bits."""
    settings = LocationSettings(method=method, line_shifts=variant.line_shifts, **_known(scene))
    errors, sigmas, times = [], [], []
    try:
        for packed, places in _packed(variant, scene):
            before = time.thread_time_ns()
            blobs = measure(packed, None, settings)
            times.append(time.thread_time_ns() - before)
            blob, place = _matched(blobs, places)
            errors.append(blobs.xy_px[blob] - places[place])
            sigmas.append(_sigma_px(blobs)[blob])
    except InputError:
        return None
    error, sigma = np.concatenate(errors), np.concatenate(sigmas)
    rms, predicted = np.sqrt((error**2).mean(axis=0)), np.sqrt((sigma**2).mean(axis=0))
    return Pointing(rms, predicted, error.mean(axis=0), float(np.median(times[1:])) / 1000)


def _known(scene: Scene) -> dict[str, float]:
    smallest_px = min(2.5, scene.diameter_mm / MM_A_PX * 0.9)
    return {"line_jitter_px": scene.jitter_px, "min_diameter_px": smallest_px}


def _sigma_px(blobs: Blobs) -> Array:
    sigma = blobs.sigma_px.copy()
    sigma[:, 0] = np.hypot(sigma[:, 0], blobs.common_px)
    return sigma


def _matched(blobs: Blobs, places: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Of every place with a whole blob near it: the blob, and the place."""
    distance = np.hypot(*(blobs.xy_px[:, np.newaxis] - places).transpose(2, 0, 1))
    blob = distance.argmin(axis=0)
    near = (distance.min(axis=0) < NEAR_PX) & ~blobs.at_border[blob]
    return blob[near], np.flatnonzero(near)


@cache
def _packed(variant: Variant, scene: Scene) -> list[tuple[PackedField, Array]]:
    fields = _fields(scene)
    counts = np.bincount(fields[0][0].luma.ravel(), minlength=256)
    threshold = choose_threshold(counts, ThresholdRule(), variant.bits)
    lines = double_lines if variant.doubled else (lambda field: field)
    return [(quantise(lines(field), variant.bits, threshold), places) for field, places in fields]


@cache
def _fields(scene: Scene) -> list[tuple[Field, Array]]:
    """8-bit fields, and where the targets are in them."""
    spread = {"spread_x_px": SPREAD_PX, "spread_y_px": SPREAD_PX}
    picture = {"noise": scene.noise, "jitter_px": scene.jitter_px, **spread}
    asked = {"scene": "calibration_frame", "target_diameter_mm": scene.diameter_mm, "picture": picture}
    options = FakeOptions.read(asked)
    grabber = GRABBERS.create("fake", {**asked, "pace": "free"})
    grabber.open()
    fields: list[tuple[Field, Array]] = []
    while len(fields) < FIELDS:
        with grabber.dequeue(1.0) as some:
            fields += [
                (Field.intact(one.field.luma.copy(), one.field.parity), _places(options, one.time_ns))
                for one in some
            ]
    grabber.close()
    return fields[:FIELDS]


def _places(options: FakeOptions, time_ns: int) -> Array:
    truth = truth_at(options, time_ns)
    return np.concatenate([truth.left_px[truth.visible_left], truth.right_px[truth.visible_right]])


def _cramer_rao_px(jitter_px: float) -> tuple[float, float]:
    """(sn/C) √(2 sb py / (√π R)), with sb that of spread and pixel, or of spread and a row of two lines."""
    blobs = measure(_packed(Variant(8, False, False), Scene(jitter_px))[0][0], None, LocationSettings())
    radius = math.sqrt(float(np.median(blobs.area_px)) / math.pi) - 0.5
    spreads = math.hypot(SPREAD_PX, 12**-0.5), math.hypot(SPREAD_PX, 3**-0.5)
    x, y = (NOISE * math.sqrt(2 * spread * 2 / (math.sqrt(math.pi) * radius)) for spread in spreads)
    return x, y
