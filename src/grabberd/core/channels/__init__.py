"""Quantities measured beside the picture, such as the vacuum, dated on the fields' own clock.

`logger` is the contract that every driver of a data logger implements. `clock_relation` dates readings that
carry the logger's own time, `arrival_dating` those without any; `missing_readings` counts what did not come.
"""

from grabberd.core.channels.arrival_dating import ArrivalDating
from grabberd.core.channels.clock_relation import ClockRelation, Dated
from grabberd.core.channels.logger import Anomaly, Dating, Logger, LoggerInfo, Quantity, Readings
from grabberd.core.channels.missing_readings import MissingReadings

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
