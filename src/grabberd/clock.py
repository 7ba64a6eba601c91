"""The documented path of the clocks that drivers take, so that tests can control time."""

from grabberd.runtime import Clock, SystemClock, UtcClock

__all__ = ["Clock", "SystemClock", "UtcClock"]
