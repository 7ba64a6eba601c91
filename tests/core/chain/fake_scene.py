"""Fields of the simulated grabber, and what is true in them."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from grabberd.bounded_documents import parse_yaml
from grabberd.core.chain.measure import MeasureSetup, measure_fields
from grabberd.core.field import Field, NumberedField, double_lines, quantise
from grabberd.core.geometry import Calibration
from grabberd.core.measurement import ThresholdRule, choose_threshold
from grabberd.core.reconstruction import ObjectModel
from grabberd.core.reconstruction.accuracy import Coordinates, Truth
from grabberd.core.reconstruction.points import PointSeries
from grabberd_fake import FakeGrabber, JumpingClock, truth_at
from grabberd_fake.__main__ import calibration_document, object_document


@dataclass(frozen=True, eq=False)
class Scene:
    """Grey fields with their times, the truth, and the setup that they are measured with."""

    fields: list[tuple[int, Field]]
    truth: Truth
    setup: MeasureSetup

    def packed(self, bits, lines):
        """Numbered fields as a ring delivers them, with the automatic threshold of the first."""
        counts = np.bincount(self.fields[0][1].luma.ravel(), minlength=256)
        threshold = choose_threshold(counts, ThresholdRule(), bits)
        for n, (time_ns, field) in enumerate(self.fields):
            whole = field if lines == "field" else double_lines(field)
            whole = Field.progressive(whole.luma) if lines == "progressive" else whole
            yield NumberedField(n, time_ns, n, quantise(whole, bits, threshold))

    @lru_cache(maxsize=2)  # noqa: B019 - a scene has hundreds of pictures; two are compared at a time
    def measured(self, bits, lines):
        """Every field measured."""
        return list(measure_fields(self.packed(bits, lines), self.setup))


def coordinates(measured):
    """All points of measured fields."""
    return Coordinates.of_series(PointSeries.of((one.n, one.time_ns, one.points) for one in measured))


def take_scene(count, **options):
    """`count` fields of a simulated grabber with these options, measured with its exact calibration."""
    grabber = FakeGrabber(pace="free", clock=JumpingClock(), **options)
    grabber.open()
    fields = []
    while len(fields) < count:
        with grabber.dequeue(1.0) as grabbed:
            fields += [(one.time_ns, replace(one.field, luma=one.field.luma.copy())) for one in grabbed]
    grabber.close()
    setup = MeasureSetup(
        calibration=Calibration.from_document(calibration_document(grabber.options)),
        object_model=ObjectModel.from_document(parse_yaml(object_document(grabber.options), fast=True)),
    )
    return Scene(fields, _truth(grabber.options, [time_ns for time_ns, _ in fields]), setup)


def _truth(options, times_ns):
    truths = [truth_at(options, time_ns) for time_ns in times_ns]
    return Truth(
        n=np.repeat(np.arange(len(truths)), [len(one.ids) for one in truths]),
        target=np.concatenate([one.ids for one in truths]),
        xyz_mm=np.concatenate([one.xyz_mm for one in truths]),
        expected=np.concatenate([one.visible_left & one.visible_right for one in truths]),
    )
