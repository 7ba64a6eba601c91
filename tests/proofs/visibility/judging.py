"""Points of closing walls against how each view truly saw every disc: found, missing, wrong, and robbed."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from tests.proofs.visibility.closing_wall import DIAMETER_MM, Closing
from tests.proofs.visibility.wall_pictures import FIELD_NS, Seen, exact_calibration, eyes, grey

from grabberd.core.chain.accuracy import requantised
from grabberd.core.chain.measure import MeasuredField, MeasureSetup, measure_fields
from grabberd.core.field import NumberedField
from grabberd.core.reconstruction import CoverageTally, ObjectModel

MOST_TILT_DEG, LEAST_UNCOVERED, LEAST_ACROSS_PX = 65.0, 0.7, 4.0
WRONG_MM, WRONG_SIGMA, OWN_PX = 0.3, 6.0, 1.5
ALL = range(30)


class Judged(NamedTuple):
    """Counts over fields.

    Attributes:
        visible: Discs that both views see by `MOST_TILT_DEG` and `LEAST_UNCOVERED`, merged ones apart.
        missing: Those without a point.
        wide, missing_wide: Likewise of those that are `LEAST_ACROSS_PX` wide in both views.
        merged: Discs that would be visible but share their spot with another.
        points: All points, those of other discs included.
        wrong: Points of another disc, or that far from the truth.
        robbed: Points with the image of another disc in a view.
        expected, found: As the coverage of the run says.
        square: Sum of e·C⁻¹·e over the points that are not wrong.
        worst_mm: Greatest distance of a point from its disc.
    """

    visible: int = 0
    missing: int = 0
    wide: int = 0
    missing_wide: int = 0
    merged: int = 0
    points: int = 0
    wrong: int = 0
    robbed: int = 0
    expected: int = 0
    found: int = 0
    square: float = 0.0
    worst_mm: float = 0.0

    @property
    def chi2(self) -> float:
        """Mean square error of the right points in units of its variance."""
        return self.square / max(3 * (self.points - self.wrong), 1)

    @property
    def share(self) -> float:
        """Share of what is visible that has a point."""
        return 1.0 - self.missing / max(self.visible, 1)

    @classmethod
    def sum_of(cls, parts: "Iterable[Judged]") -> "Judged":
        """Counts of all parts together."""
        columns = list(zip(*parts, strict=True))
        return cls(*(sum(column) for column in columns[:-1]), max(columns[-1]))


class Film:
    """The fields of a scene, and what is true in each."""

    def __init__(self, scene: Closing, fields: range = ALL, mirrored: bool | None = None) -> None:
        self.scene, rng = scene, np.random.default_rng((scene.seed, 43))
        pair = eyes(scene.seed % 2 == 1 if mirrored is None else mirrored)
        self.calibration = exact_calibration(pair)
        self.fields, self.seen, self.xyz_mm = [], [], []
        for n in fields:
            time_s = n * FIELD_NS / 1e9
            halves = [eye.picture(scene, time_s, scene.exposure_ms / 1000) for eye in pair]
            self.fields.append(grey(halves[0] + halves[1], n, rng))
            self.seen.append(
                [eye.truth(scene, time_s, own, n % 2) for eye, own in zip(pair, halves, strict=True)]
            )
            self.xyz_mm.append(scene.discs(time_s)[0])

    @property
    def setup(self) -> MeasureSetup:
        """Of the wall as it is open."""
        return MeasureSetup(self.calibration, model_of(self.scene))

    def measured(self, bits: int = 8) -> tuple[list[MeasuredField], CoverageTally]:
        """Measure with 8 bits, or with 1 bit and doubled lines."""
        setup = self.setup
        tally = CoverageTally(setup.calibration, setup.object_model)
        fields: Iterable[NumberedField] = (
            self.fields if bits == 8 else requantised(self.fields, bits, doubled=True)
        )
        return list(measure_fields(fields, setup, tally)), tally

    def judged(self, bits: int = 8) -> Judged:
        """Measure, and compare with the truth."""
        measured, tally = self.measured(bits)
        fields = zip(measured, self.seen, self.xyz_mm, strict=True)
        coverage = tally.result()
        counts = {"expected": int(coverage.expected.sum()), "found": int(coverage.found.sum())}
        return Judged.sum_of([judge(*one) for one in fields])._replace(**counts)


def judge(measured: MeasuredField, seen: list[Seen], xyz_mm: np.ndarray) -> Judged:
    """Judge one field."""
    points, got = measured.points, np.zeros(len(xyz_mm), bool)
    at = points.target - 1
    got[at] = True
    off = points.xyz_mm - xyz_mm[at]
    off_mm = np.linalg.norm(off, axis=1)
    square = np.einsum("ni,nij,nj->n", off, np.linalg.inv(points.covariance_mm2), off)
    sigma_mm = np.sqrt(np.trace(points.covariance_mm2, axis1=1, axis2=2))
    robbed = _robbed(points.image_px, at, seen)
    wrong = robbed | ((off_mm > WRONG_MM) & (off_mm > WRONG_SIGMA * sigma_mm))
    clear, merged = visible(seen)
    wide = np.logical_and.reduce([view.across_px >= LEAST_ACROSS_PX for view in seen])
    alone = clear & ~merged
    counts = alone, alone & ~got, alone & wide, alone & wide & ~got, clear & merged
    return Judged(
        *(int(one.sum()) for one in counts),
        points=len(at),
        wrong=int(wrong.sum()),
        robbed=int(robbed.sum()),
        square=float(square[~wrong].sum()),
        worst_mm=float(off_mm.max(initial=0.0)),
    )


def visible(seen: list[Seen]) -> tuple[np.ndarray, np.ndarray]:
    """(N,) True for discs that both views see, merged or not; and for those that are merged in one."""
    clear = np.logical_and.reduce(
        [(view.tilt_deg <= MOST_TILT_DEG) & (view.uncovered >= LEAST_UNCOVERED) & view.whole for view in seen]
    )
    return clear, np.logical_or.reduce([view.merged for view in seen])


def _robbed(image_px: np.ndarray, at: np.ndarray, seen: list[Seen]) -> np.ndarray:
    """(N,) True for points one of whose images is that of another disc."""
    robbed = np.zeros(len(at), bool)
    for k, view in enumerate(seen):
        away = np.linalg.norm(image_px[:, k, np.newaxis] - view.image_px, axis=2)
        away[:, ~((view.tilt_deg < 90.0) & (view.uncovered > 0.0))] = np.inf
        own = np.take_along_axis(away, at[:, np.newaxis], axis=1)[:, 0]
        robbed |= (away.argmin(axis=1) != at) & (own > OWN_PX)
    return robbed


def model_of(scene: Closing) -> ObjectModel:
    """The object file: the wall as it is open, its targets placed by hand."""
    xyz_mm = scene.discs(0.0)[0]
    targets = [
        {"id": k + 1, "x_mm": x, "y_mm": y, "z_mm": z, "row": int(row), "column": int(column)}
        for k, ((x, y, z), row, column) in enumerate(zip(xyz_mm.tolist(), *scene.grid, strict=True))
    ]
    about = {"name": "closing wall", "target_diameter_mm": DIAMETER_MM, "sigma_mm": 0.3}
    return ObjectModel.from_document({**about, "targets": targets})
