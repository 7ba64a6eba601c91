"""Single fields at few and many bits against the truth of another renderer, behind rigs set aside."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import yaml
from tests.core.chain.averaging import ACROSS, DOWN, Averaged, averaged_discs, calibrated, liner
from tests.core.chain.leaning_scene import Discs
from tests.core.chain.pinhole_pictures import Optics
from tests.proofs.bench.goals import NAMES

from grabberd.config.daemon import shipped_configs
from grabberd.core.reconstruction import ObjectModel

SEEDS = (421, 423, 425, 427)
"""Lens and principal point of rigs with two reflections a view, none of which a constant was chosen with."""
FOCAL_MM, BASE_MM, DISTANCE_MM = 8.0, 128.0, 240.0
SHAPES = {
    "accuracy object": "objects/accuracy-object",
    "calibration frame": "calibration-frames/paper-108",
}
LINERS = {"liner down the picture": DOWN, "liner across the picture": ACROSS}
SHIFTS = {"": None, ", line shifts left alone": False}


def table() -> str:
    """XYZ RMSE and χ² of single fields, and which points are missing or another target's."""
    about = (
        f"{len(SEEDS)} rigs, two reflections a view, {DISTANCE_MM:.0f} mm away, base {BASE_MM:.0f} mm, focal "
        f"length {FOCAL_MM:.0f} mm, even mirrors, calibrated from 64 fields; 32 fields each of discs of "
        "1.5 mm, noise 3.6 of 180 grey values, line jitter .12 px. The threshold is the automatic one.\n"
    )
    head = "| object | field | XYZ, mm | χ² | missing | wrong |\n|---|---|---|---|---|---|"
    return "\n".join([about, head, *_rows()])


def _rows() -> Iterator[str]:
    for shape in (*SHAPES, *LINERS):
        for (bits, doubled), name in NAMES.items():
            for way, line_shifts in SHIFTS.items():
                found = [_found(shape, seed, bits, doubled, line_shifts) for seed in SEEDS]
                error, chi2 = (
                    np.array([getattr(one, f"single_{of}") for one in found]) for of in ("mm", "chi2")
                )
                missed, wrong = sum(one.missed for one in found), sum(one.wrong for one in found)
                numbers = f"{np.sqrt((error**2).mean()):.4f} | {chi2.mean():.2f} | {missed} | {wrong}"
                yield f"| {shape} | {name}{way} | {numbers} |"


def _found(shape: str, seed: int, bits: int, doubled: bool, line_shifts: bool | None) -> Averaged:
    arranged = {"focal_mm": FOCAL_MM, "base_mm": BASE_MM, "distance_mm": DISTANCE_MM}
    optics = replace(Optics.drawn(seed), **arranged)
    known, mirrors = calibrated(seed, 0.0, dim=1.0, optics=optics)
    if shape in LINERS:
        discs = liner(LINERS[shape], seed, optics)
    else:
        document = yaml.safe_load((shipped_configs() / f"{SHAPES[shape]}.yaml").read_text())
        discs = Discs.facing(ObjectModel.from_document(document).xyz_mm)
    return averaged_discs(known, mirrors, discs, seed, bits=bits, doubled=doubled, line_shifts=line_shifts)
