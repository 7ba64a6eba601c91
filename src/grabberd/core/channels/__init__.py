"""Quantities measured beside the picture, such as the vacuum, dated on the fields' own clock.

`logger` is the contract that every driver of a data logger implements. `dating` dates its readings, by the
logger's own time or by their arrival, and counts what did not come; `vacuum` converts them to kPa below
atmosphere, `account` tells how many a capture has and where there are none.
"""

from grabberd.core.channels.dating import ArrivalDating, ClockRelation, Dated, MissingReadings
from grabberd.core.channels.logger import Anomaly, Dating, Logger, LoggerInfo, Quantity, Readings

__all__ = [
    "Anomaly",
    "ArrivalDating",
    "ClockRelation",
    "Dated",
    "Dating",
    "Logger",
    "LoggerInfo",
    "MissingReadings",
    "Quantity",
    "Readings",
]
