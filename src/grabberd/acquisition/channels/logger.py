"""The documented path of the logger contract."""

from grabberd.core.channels.logger import Anomaly, Dating, Logger, LoggerInfo, Quantity, Readings

__all__ = ["Anomaly", "Dating", "Logger", "LoggerInfo", "Quantity", "Readings"]
