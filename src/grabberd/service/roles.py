"""What somebody may."""

from enum import StrEnum


class Role(StrEnum):
    """Look; capture, calibrate and measure; everything. Each may what those before it may."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"

    def covers(self, least: "Role") -> bool:
        """Whether this role is enough where `least` is asked for."""
        order = list(Role)
        return order.index(self) >= order.index(least)
