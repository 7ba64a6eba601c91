"""The documented path of channels and of the logger contract."""

from grabberd.core.channels import (
    Anomaly,
    ArrivalDating,
    ClockRelation,
    Dated,
    Dating,
    Logger,
    LoggerInfo,
    MissingReadings,
    Quantity,
    Readings,
)

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
