"""The points of a field as an analysis takes them."""

from typing import NamedTuple

from grabberd_liner.analysis import TimedPoints


class FieldPoints(NamedTuple):
    """The points of one field; `time_s` from the capture's first field."""

    n: int
    timed: TimedPoints
