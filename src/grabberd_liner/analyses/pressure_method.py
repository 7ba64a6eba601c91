"""The way in which an analysis found its pressures."""

PRESSURE_METHOD = "equilibrium"
"""Pressure as the load of a wall in equilibrium (docs/decisions/0021). Earlier analyses name no method."""


def is_outdated(method: str | None, has_pressures: bool) -> bool:
    """True if an analysis has pressures of the earlier, wrong way."""
    return has_pressures and method is None
