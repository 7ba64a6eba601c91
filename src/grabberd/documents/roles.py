"""The roles that a token can have."""

from enum import StrEnum


class Role(StrEnum):
    """Look; capture, calibrate and measure; everything. Each role includes the ones before it."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"
