"""The missing lines of a field (paper 3.3)."""

import cv2
import numpy as np

from grabberd.field.field import Field


def double_lines(field: Field) -> Field:
    """The field with its missing lines interpolated linearly on the grey values, a picture of full height.

    A missing line is the mean of its neighbours, rounded half up; beyond the outermost line its only
    neighbour is repeated. A field whose lines are doubled already is returned as it is, so a recording of
    doubled fields passes through unchanged. A field has at least two rows.
    """
    if field.y_step == 1:
        return field
    rows, columns = field.luma.shape
    doubled = np.empty((2 * rows, columns), np.uint8)
    doubled[field.parity :: 2] = field.luma
    between = cv2.addWeighted(field.luma[:-1], 0.5, field.luma[1:], 0.5, 0.25)
    doubled[1 + field.parity : 2 * rows - 1 + field.parity : 2] = between
    doubled[-1 if field.parity == 0 else 0] = field.luma[-1 if field.parity == 0 else 0]
    return Field(doubled, field.parity, y0=0, y_step=1)
