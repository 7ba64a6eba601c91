"""Enumerations of documents: states of devices and jobs, steps of recovery, roles of tokens.

A command's help loads them, so they need no pydantic. Transitions between states belong to the instrument.
"""

from enum import StrEnum


class DeviceState(StrEnum):
    """State of a grabber, as an operator needs to know it."""

    ABSENT = "absent"
    OPENING = "opening"
    NO_SIGNAL = "no_signal"
    READY = "ready"
    CAPTURING = "capturing"
    RECOVERING = "recovering"
    FAILED = "failed"
    ENDED = "ended"


class Rung(StrEnum):
    """A step of the recovery ladder, the gentlest first."""

    RESTART = "restart"
    """Stop and start the stream of the open device."""
    REOPEN = "reopen"
    """Close and open the device."""
    RESET = "reset"
    """Close the device, reset it as pulling its plug would, and open it."""
    RETRY = "retry"
    """Close and open the device after a while."""


class JobState(StrEnum):
    """Progress of a job."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


class Role(StrEnum):
    """Look; capture, calibrate and measure; everything. Each role includes the ones before it."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"
