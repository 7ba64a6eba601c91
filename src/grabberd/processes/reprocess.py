"""Re-measurement of a capture's fields, in groups that bound the memory in use."""

from collections.abc import Iterable, Iterator
from itertools import islice

from grabberd.errors import CalibrationMismatch, MeasurementError
from grabberd.field import NumberedField
from grabberd.processes.measure import MeasuredField, MeasureSetup, measure_fields

FIELDS_A_GROUP = 500
"""Ten seconds of video."""


def measured_groups(
    fields: Iterable[NumberedField], setup: MeasureSetup, fields_a_group: int = FIELDS_A_GROUP
) -> Iterator[list[MeasuredField]]:
    """Measures every field, in groups; the results are those of `measure_fields`.

    Raises:
        CalibrationMismatch: a field's size differs from the calibration's.
        MeasurementError: there are no fields, or no points in any of them.
    """
    measured = measure_fields(_fitting(fields, setup), setup)
    count = points = 0
    while group := list(islice(measured, fields_a_group)):
        count += len(group)
        points += sum(len(one.points) for one in group)
        yield group
    if not count:
        raise MeasurementError(
            "the capture has no undamaged field to measure", "the capture's ledger gives the reasons"
        )
    if not points:
        raise MeasurementError(
            f"no target of the object model was found in any of {count} fields",
            "check that calibration and object model belong to this capture's rig and object",
        )


def _fitting(fields: Iterable[NumberedField], setup: MeasureSetup) -> Iterator[NumberedField]:
    known = setup.calibration
    for field in fields:
        lines = field.packed.rows * field.packed.y_step
        if (field.packed.columns, lines) != (known.columns, known.lines):
            raise CalibrationMismatch(
                f"calibration {known.id} is for pictures of {known.columns} x {known.lines}, "
                f"field {field.n} has {field.packed.columns} x {lines}",
                "measure this capture with a calibration of its own grabber",
            )
        yield field
