"""The roles that a token can have."""

from enum import StrEnum


class Role(StrEnum):
    """Look; capture, calibrate and measure; everything. Each role includes the ones before it."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"

    def covers(self, least: "Role") -> bool:
        """True if this role is enough where `least` is required."""
        ascending = list(Role)
        return ascending.index(self) >= ascending.index(least)
