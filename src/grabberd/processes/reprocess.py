"""A capture's fields to points again, in groups, so that memory holds few of them."""

from collections.abc import Iterable, Iterator
from itertools import islice

from grabberd.errors import CalibrationMismatch, MeasurementError
from grabberd.field import NumberedField
from grabberd.processes.measure import MeasuredField, MeasureSetup, measure_fields

FIELDS_A_GROUP = 500


def measured_groups(
    fields: Iterable[NumberedField], setup: MeasureSetup, fields_a_group: int = FIELDS_A_GROUP
) -> Iterator[list[MeasuredField]]:
    """Every field measured, so many at a time; the same as `measure_fields` gives one by one.

    Raises:
        CalibrationMismatch: a field is not of the calibration's size.
        MeasurementError: there is no field, or not one point in any of them.
    """
    measured = measure_fields(_fitting(fields, setup), setup)
    count = points = 0
    while group := list(islice(measured, fields_a_group)):
        count += len(group)
        points += sum(len(one.points) for one in group)
        yield group
    if not count:
        raise MeasurementError(
            "no field came whole, so there is nothing to measure", "the capture's ledger says why"
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
                f"field {field.n} is of one of {field.packed.columns} x {lines}",
                "measure this capture with a calibration of its own grabber",
            )
        yield field
