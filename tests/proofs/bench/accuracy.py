"""Points of the simulated liner and accuracy object against the simulator's truth, in tables."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
from yaml import safe_load

from grabberd.core.chain.accuracy import (
    Compared,
    Investigation,
    InvestigationSettings,
    investigate,
    requantised,
)
from grabberd.core.chain.measure import MeasureSetup, measure_fields
from grabberd.core.field import Field, NumberedField, quantise
from grabberd.core.geometry import Calibration
from grabberd.core.reconstruction import ObjectModel
from grabberd.core.reconstruction.accuracy import PAPER_PRECISION, PAPER_RMSE, Truth
from grabberd_fake import FakeGrabber, FakeOptions, truth_at
from grabberd_fake.__main__ import calibration_document, object_document
from grabberd_fake.grabber import JumpingClock

FIELDS = 64
START_NS = 10_000_000_000
"""On the simulator's clock: what moves is the same in every run."""
ANY_THRESHOLD = 76
"""Of the 8-bit fields; each number of bits chooses its own."""
VARIANTS = (("1 bit, doubled", 1, True), ("1 bit, 288 lines", 1, False), ("8 bit, 288 lines", 8, False))
SCENES = (
    ("liner, mirror error .06 px", {"scene": "liner"}),
    ("liner, ideal mirrors", {"scene": "liner", "rig": {"mirror_error_px": 0}}),
    ("accuracy object, mirror error .06 px", {"scene": "accuracy_object"}),
    ("accuracy object, ideal mirrors", {"scene": "accuracy_object", "rig": {"mirror_error_px": 0}}),
)
BITS = ((1, True), *((bits, False) for bits in range(1, 9)))
PICTURE = "2 % noise, line jitter .12 px, spread .8 px; the exact calibration"


def table() -> str:
    """RMSE of single fields and smoothed over time, and what was found; then Table 1 for 1…8 bits."""
    return f"{FIELDS} fields, {PICTURE}.\n\n{_scenes()}\n\n{_table_1()}"


def _scenes() -> str:
    head = (
        "| scene | field | X | Y | Z | XYZ | XYZ smoothed | its error / stated σ "
        "| found of what both views see | wrong |"
    )
    rows = []
    for name, options in SCENES:
        scene = Scene(options)
        rows += [_row(name, variant, scene.investigated(*how)) for variant, *how in VARIANTS]
    return "\n".join([head, "|---|---|---|---|---|---|---|---|---|---|", *rows])


def _row(name: str, variant: str, result: Investigation) -> str:
    table = result.single.accuracy
    figures = " | ".join(f"{value:.3f}" for value in table.rmse)
    smoothed = f"{result.smoothed.accuracy.rmse.xyz_mm:.4f} | {np.sqrt(result.smoothed.chi2):.2f}"
    wanted = table.matched + table.missing + table.wrong
    return f"| {name} | {variant} | {figures} | {smoothed} | {table.matched} of {wanted} | {table.wrong} |"


def _table_1() -> str:
    """The paper's Table 1 for 1…8 bits, as `grabberd accuracy --bits` prints it."""
    head = (
        "| accuracy object, ideal mirrors | X | Y | Z | XYZ | length-measuring error | pointing x / y, px |"
    )
    lines = [
        "Table 1 for 1…8 bits: `grabberd accuracy CAPTURE --truth truth.csv --bits 1,2,3,4,5,6,7,8`.\n",
        head,
        "|---|---|---|---|---|---|---|",
        f"| the paper, RMSE | {_axes(PAPER_RMSE)} | | |",
        f"| the paper, precision | {_axes(PAPER_PRECISION)} | | .170 / .225 |",
    ]
    scene = Scene({"scene": "accuracy_object", "rig": {"mirror_error_px": 0}})
    for bits, doubled in BITS:
        result = scene.investigated(bits, doubled)
        name = f"{bits} bit{'s' * (bits > 1)}, {'doubled' if doubled else '288 lines'}"
        assert result.pointing is not None
        x, y = result.pointing.both_px
        lines.append(f"| {name}, RMSE | {_result(result.single)} | {x:.3f} / {y:.3f} |")
        lines.append(f"| {name}, smoothed | {_result(result.smoothed)} | |")
    return "\n".join(lines)


def _result(compared: Compared) -> str:
    assert compared.lengths is not None
    return f"{_axes(compared.accuracy.rmse)} | {compared.lengths.greatest_mm:+.3f}"


def _axes(axes: tuple[float, ...]) -> str:
    return " | ".join(f"{value:.4f}" for value in axes)


class Scene:
    """Grey fields of the simulator, and what is true in them."""

    def __init__(self, options: dict[str, Any], count: int = FIELDS) -> None:
        known = FakeOptions.read(options)
        self.setup = MeasureSetup(
            Calibration.from_document(json.loads(json.dumps(calibration_document(known)))),
            ObjectModel.from_document(safe_load(object_document(known))),
        )
        self.fields = list(grabbed(options, count))
        self._truth = _truth(options, self.fields)

    def investigated(self, bits: int, doubled: bool) -> Investigation:
        fields = requantised(self.fields, bits, doubled=doubled)
        points = ((one.n, one.time_ns, one.points) for one in measure_fields(fields, self.setup))
        return investigate(points, self._truth, InvestigationSettings(bits=bits))


def grabbed(options: dict[str, Any], count: int) -> Iterator[NumberedField]:
    grabber = FakeGrabber(clock=JumpingClock(START_NS), **{**options, "pace": "free"})
    grabber.open()
    n = 0
    while n < count:
        with grabber.dequeue(1.0) as some:
            for one in some:
                intact = Field.intact(one.field.luma, one.field.parity)
                yield NumberedField(n, one.time_ns, n, quantise(intact, 8, ANY_THRESHOLD))
                n += 1
    grabber.close()


def _truth(options: dict[str, Any], fields: list[NumberedField]) -> Truth:
    truths = [truth_at(options, field.time_ns) for field in fields]
    count = len(truths[0].ids)
    return Truth(
        n=np.repeat([field.n for field in fields], count).astype(np.int64),
        target=np.concatenate([truth.ids for truth in truths]),
        xyz_mm=np.concatenate([truth.xyz_mm for truth in truths]),
        expected=np.concatenate([truth.visible_left & truth.visible_right for truth in truths]),
    )
