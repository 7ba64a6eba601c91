"""Roles of those who use the daemon."""

from enum import StrEnum


class Role(StrEnum):
    """A viewer may look; an operator also capture, calibrate and measure; an admin everything."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"

    def covers(self, least: "Role") -> bool:
        """True if this role may do what `least` may."""
        roles = list(Role)
        return roles.index(self) >= roles.index(least)
