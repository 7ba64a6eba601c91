"""Images of the targets that one view alone sees, beside the points of the same fields."""

from collections.abc import Iterable, Iterator, Mapping

from grabberd.core.chain.locating import Locating, whole_blobs
from grabberd.core.chain.measure import MeasureSetup
from grabberd.core.field import NumberedField
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import (
    Correspondence,
    ImageNoise,
    Points,
    SingleViewImages,
    SingleViewSearch,
)


def single_view_images(
    fields: Iterable[NumberedField], points: Mapping[int, Points], setup: MeasureSetup
) -> Iterator[tuple[int, SingleViewImages]]:
    """Images of the targets of each field that have no point, because one view alone sees them.

    Points are those of two views, so an analysis that can use one view's rays locates the fields once more.

    Args:
        fields: of a capture, in order.
        points: measured in them, by the field's number; other fields are left out.
        setup: of the measurement that made the points.
    """
    searching: _Searching | None = None
    for numbered in fields:
        if numbered.n not in points:
            continue
        # Lines of other kinds have different σ of their image coordinates.
        if searching is None or searching.lines != numbered.packed.lines:
            searching = _Searching(setup, numbered.packed.lines)
        yield numbered.n, searching.images(numbered, points[numbered.n])


class _Searching:
    """Location and search for fields with the same lines."""

    def __init__(self, setup: MeasureSetup, lines: tuple[int, int]) -> None:
        self.lines = lines
        self._locating = Locating(setup.sized, setup.line_jitter_px)
        known, model = setup.calibration, setup.object_model
        self._halves = tuple(zip(known.views, known.local_fields, strict=True))
        rig = Rig.of(known)
        noise = ImageNoise.of(rig, model, setup.line_jitter_px, *lines)
        self._search = SingleViewSearch(Correspondence(rig, model, noise, setup.tracking.correspondence))

    def images(self, numbered: NumberedField, points: Points) -> SingleViewImages:
        blobs = self._locating.blobs(numbered.packed)
        left, right = (whole_blobs(blobs, *half) for half in self._halves)
        return self._search.images(points, left, right)
