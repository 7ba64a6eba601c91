"""Draws docs/images/field.jpg: one simulated field, its targets ringed. `make docs` runs it."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.acquisition import create
from grabberd.config import default_config_file, load_config
from grabberd.field import Field, NumberedField, double_lines, quantise
from grabberd.processes.measure import MeasuredField, measure_fields
from grabberd.service.setup import set_up

THRESHOLD = 60
SCALE = 2
RING, INK, SEAM = (80, 220, 255), (120, 200, 120), (90, 90, 90)


def main() -> None:
    """Grabs, measures, draws and writes."""
    doubled = double_lines(_grabbed())
    picture = drawn(doubled, _measured(doubled))
    cv2.imwrite(str(Path(__file__).with_name("field.jpg")), picture, [cv2.IMWRITE_JPEG_QUALITY, 82])


def drawn(field: Field, measured: MeasuredField) -> NDArray[np.uint8]:
    """(rows, columns, 3) uint8: the field, enlarged, each target ringed in both views, with its id in one."""
    big = cv2.resize(field.luma, None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_CUBIC)
    picture = cv2.cvtColor(big, cv2.COLOR_GRAY2BGR)
    middle = picture.shape[1] // 2
    cv2.line(picture, (middle, 0), (middle, picture.shape[0]), SEAM, 1)
    for target, views in zip(measured.points.target, measured.points.image_px, strict=True):
        for view, (x, y) in enumerate(views):
            place = (round(SCALE * x), round(SCALE * y))
            cv2.circle(picture, place, 11, RING, 1, cv2.LINE_AA)
            if view == 0:
                corner = (place[0] + 12, place[1] + 4)
                cv2.putText(picture, str(target), corner, cv2.FONT_HERSHEY_SIMPLEX, 0.33, INK, 1, cv2.LINE_AA)
    return np.asarray(picture, np.uint8)


def _grabbed() -> Field:
    grabber = create("fake", {"pace": "free", "picture": {"stamp": False}})
    grabber.open()
    try:
        with grabber.dequeue(1.0) as fields:
            return Field.intact(fields[0].field.luma.copy(), fields[0].field.parity)
    finally:
        grabber.close()


def _measured(doubled: Field) -> MeasuredField:
    file = default_config_file()
    setup = next(iter(set_up(load_config(file), file).values())).measuring
    assert setup
    return next(measure_fields([NumberedField(0, 0, 0, quantise(doubled, 1, THRESHOLD))], setup))


if __name__ == "__main__":
    main()
