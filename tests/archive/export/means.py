"""Means of exported points, computed as the documentation says, beside the true places of drawn discs."""

import re
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from tests.archive.captures import meta
from tests.core.chain.averaging import liner, object_model
from tests.core.chain.leaning_scene import FIELD_NS, Discs, LeaningScene

from grabberd.archive.export.points_columns import POINT_COLUMNS, rows_of
from grabberd.archive.export.table_files import csv_text
from grabberd.core.chain.accuracy import requantised
from grabberd.core.chain.measure import MeasureSetup, measure_fields

DOCUMENT = Path(__file__).parents[3] / "docs/reference/points.md"
FIELDS = 32
AXES = ["x_mm", "y_mm", "z_mm"]
SIGMAS = [f"sigma_{axis}" for axis in AXES]
AT_REST, DRIFTING = (0.0, 0.0, 0.0), (0.2, 0.15, 0.0)
"""Movement in mm during the mean; .26 mm are a pixel."""


class Means(NamedTuple):
    """RMS error of the means in space, χ² by coordinate, and that if all errors were drawn anew."""

    error_mm: float
    chi2: float
    chi2_of_white: float


@lru_cache(maxsize=12)
def fields_of(axis, seed, mirrors, moved_mm):
    """Fields of a liner that moves evenly, two at a time, and the (FIELDS, N, 3) places in each."""
    discs, fields, places = liner(axis, seed), [], []
    for pair in range(FIELDS // 2):
        now = Discs(discs.xyz_mm + np.multiply(moved_mm, pair / (FIELDS // 2 - 1) - 0.5), discs.normal)
        if not pair or any(moved_mm):
            scene = LeaningScene(now, mirrors)
        for one in scene.fields(2, 100 * seed + pair):
            n = 2 * pair + one.n
            fields.append(one._replace(n=n, time_ns=n * FIELD_NS, sequence=n))
            places.append(now.xyz_mm)
    return fields, np.array(places)


def exported(rig, axis, seed, bits, doubled, moved_mm):
    """The points of a liner behind a rig's mirrors as columns, and the (N, 3) true place of each row."""
    known, mirrors = rig
    fields, places = fields_of(axis, seed, mirrors, moved_mm)
    if bits < 8:
        fields = requantised(fields, bits, doubled=doubled)
    measured = list(measure_fields(fields, MeasureSetup(known, object_model(places.mean(axis=0)))))
    n, time_ns = (np.array([getattr(one, name) for one in measured]) for name in ("n", "time_ns"))
    lines = "doubled" if doubled else "field"
    rows = rows_of(n, time_ns, [one.points for one in measured], meta(bits=bits, lines=lines), 0)
    return rows, places[rows["n"], rows["target"] - 1]


def documented(points_csv):
    """The frame `mean` that the documentation's lines compute from a file."""
    (lines,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text("utf-8"), re.DOTALL)
    names = {"numpy": np, "pandas": pd}
    exec(lines.replace('"points.csv"', repr(str(points_csv))), names)
    return names["mean"]


def means(folder, rig, axis, seed, bits, doubled=False, moved_mm=AT_REST):
    """Export the points of `FIELDS` fields, and compare their means with the truth."""
    rows, places = exported(rig, axis, seed, bits, doubled, moved_mm)
    file = folder / "points.csv"
    file.write_text("".join(csv_text(POINT_COLUMNS, [rows])), "utf-8")
    mean = documented(file)
    points = pd.DataFrame(rows)
    true = pd.DataFrame(places, columns=AXES).groupby([points.target, points.n // 50]).mean()
    square = (mean[AXES] - true[AXES]).to_numpy() ** 2
    of_target = points.groupby(["target", points.n // 50])
    white = sum(
        of_target[[f"{part}{name}" for name in SIGMAS]].mean().to_numpy() ** 2 / many
        for part, many in (("", of_target.size().to_numpy()[:, np.newaxis]), ("calibration_", 1.0))
    )
    return Means(
        float(np.sqrt(square.sum(axis=1).mean())),
        float((square / mean[SIGMAS].to_numpy() ** 2).mean()),
        float((square / white).mean()),
    )
