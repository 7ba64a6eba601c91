"""Quantities measured beside the picture, such as the vacuum, dated on the fields' own clock.

`logger` is the contract that every driver of a data logger implements.
"""

from grabberd.acquisition.channels.logger import Anomaly, Dating, Logger, LoggerInfo, Quantity, Readings

__all__ = ["Anomaly", "Dating", "Logger", "LoggerInfo", "Quantity", "Readings"]
