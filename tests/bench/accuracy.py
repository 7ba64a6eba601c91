"""Points of the simulated liner and accuracy object against the simulator's truth, one field at a time."""

import json
from typing import Any

import numpy as np
from yaml import safe_load

from grabberd.acquisition import create
from grabberd.field import Field, NumberedField, double_lines, quantise
from grabberd.geometry import Calibration
from grabberd.processes.accuracy import Accuracy, Coordinates, Truth, accuracy
from grabberd.processes.measure import MeasureSetup, measure_fields
from grabberd.reconstruction import ObjectModel
from grabberd_fake import FakeOptions, truth_at
from grabberd_fake.documents import calibration_document, object_document

FIELDS = 60
THRESHOLD = 76
VARIANTS = (("1 bit, doubled", 1, True), ("1 bit, 288 lines", 1, False), ("8 bit, 288 lines", 8, False))
SCENES = (
    ("liner, mirror error .06 px", {"scene": "liner"}),
    ("liner, ideal mirrors", {"scene": "liner", "rig": {"mirror_error_px": 0}}),
    ("accuracy object, mirror error .06 px", {"scene": "accuracy_object"}),
    ("accuracy object, ideal mirrors", {"scene": "accuracy_object", "rig": {"mirror_error_px": 0}}),
)


def table() -> str:
    """RMSE in mm, and what was found; 2 % noise, line jitter .12 px, spread .8 px."""
    head = "| scene | field | X | Y | Z | XYZ | found of what both views see | wrong |"
    rows = [_row(name, options, *variant) for name, options in SCENES for variant in VARIANTS]
    return "\n".join([head, "|---|---|---|---|---|---|---|---|", *rows])


def _row(name: str, options: dict[str, Any], variant: str, bits: int, doubled: bool) -> str:
    result = _accuracy(options, bits, doubled)
    figures = " | ".join(f"{value:.3f}" for value in result.rmse)
    wanted = result.matched + result.missing + result.wrong
    return f"| {name} | {variant} | {figures} | {result.matched} of {wanted} | {result.wrong} |"


def _accuracy(options: dict[str, Any], bits: int, doubled: bool) -> Accuracy:
    known = FakeOptions.read(options)
    setup = MeasureSetup(
        Calibration.from_document(json.loads(json.dumps(calibration_document(known)))),
        ObjectModel.from_document(safe_load(object_document(known))),
    )
    fields = [_numbered(n, *grabbed, bits, doubled) for n, grabbed in enumerate(_grabbed(options))]
    measured = Coordinates.of((one.n, one.points) for one in measure_fields(fields, setup))
    return accuracy(measured, _truth(options, fields))


def _grabbed(options: dict[str, Any]) -> list[tuple[int, Field]]:
    grabber = create("fake", {**options, "pace": "free"})
    grabber.open()
    fields: list[tuple[int, Field]] = []
    while len(fields) < FIELDS:
        with grabber.dequeue(1.0) as some:
            fields += [(one.time_ns, Field.intact(one.field.luma.copy(), one.field.parity)) for one in some]
    grabber.close()
    return fields


def _numbered(n: int, time_ns: int, field: Field, bits: int, doubled: bool) -> NumberedField:
    return NumberedField(n, time_ns, n, quantise(double_lines(field) if doubled else field, bits, THRESHOLD))


def _truth(options: dict[str, Any], fields: list[NumberedField]) -> Truth:
    truths = [truth_at(options, field.time_ns) for field in fields]
    count = len(truths[0].ids)
    return Truth(
        n=np.repeat([field.n for field in fields], count).astype(np.int64),
        target=np.concatenate([truth.ids for truth in truths]),
        xyz_mm=np.concatenate([truth.xyz_mm for truth in truths]),
        expected=np.concatenate([truth.visible_left & truth.visible_right for truth in truths]),
    )
