"""Profiles as their tests make them: one of each kind, complete, and changed."""

from copy import deepcopy
from typing import Any

from core.chain.milking import MATERIAL as EXAMPLE

MATERIAL = {**EXAMPLE, "E_sigma_mpa": 0.1, "wall_sigma_mm": 0.05, "F0_sigma_n": 3.0}
LAG = {"opening_s": 0.01, "closing_s": 0.02, "sigma_s": 0.005}
SETTINGS = {
    "rate_per_min": 60.0,
    "ratio": 0.6,
    "a_s": 0.1,
    "c_s": 0.08,
    "system_kpa": 42.0,
    "sigma_kpa": 0.5,
}
LINER: dict[str, Any] = {
    "kind": "liner",
    "name": "A",
    "maker": "Example",
    "material": MATERIAL,
    "obtained": {"E_mpa": "ramp", "wall_mm": "calliper", "radius_mm": "drawing", "F0_n": "spring balance"},
    "lag": LAG,
    "analysis": {"reference": "nominal", "phases": 4, "sought_kpa": 20.0},
}
PULSATOR: dict[str, Any] = {
    "kind": "pulsator",
    "name": "north",
    "pulsation": SETTINGS,
    "liner": {"kpa": 42.0, "sigma_kpa": 0.5},
}
CUP: dict[str, Any] = {
    "kind": "cup",
    "name": "1",
    "device": "teatcup",
    "object_model": "liner",
    "gauge_sigma_kpa": 0.2,
}
COW: dict[str, Any] = {
    "kind": "cow",
    "name": "112",
    "teats": {"front left": {"length_mm": 50.0, "diameter_mm": 22.0, "shape": "round"}},
    "flow_stop": {"kpa": 9.0, "sigma_kpa": 1.0},
}
ALL = (LINER, PULSATOR, CUP, COW)


def changed(document: dict[str, Any], key: str, value: Any) -> dict[str, Any]:
    """The same profile with another value at a key such as `material.E_mpa`; None removes it."""
    copy = deepcopy(document)
    *way, last = key.split(".")
    holder = copy
    for part in way:
        holder = holder.setdefault(part, {})
    if value is None:
        del holder[last]
    else:
        holder[last] = value
    return copy
