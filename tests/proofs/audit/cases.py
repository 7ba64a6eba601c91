"""What goes wrong in a run, as a seed has it: alone and together."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Faults = list[dict[str, Any]]
LASTS_S = 8.0
"""Length of a run; a capture lies somewhere in it."""


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes:
        seed: of everything that is drawn in it.
        kinds: What goes wrong, by name.
        driver: `DriverOptions` of the simulated grabber.
        buffers: of the driver.
        faults: The script.
        start_s: When the capture is asked for; `stop_s`: when it is stopped.
        pre_fields: Fields before the request that are asked for.
        fields: Length that is asked for, or None.
    """

    seed: int
    kinds: tuple[str, ...]
    driver: dict[str, Any]
    buffers: int
    faults: Faults
    start_s: float
    stop_s: float
    pre_fields: int
    fields: int | None


def _at(draw: random.Random) -> float:
    return round(draw.uniform(0.5, 7.0), 2)


def _losses(draw: random.Random, kind: str) -> Faults:
    counts = [draw.choice([1, 1, 2, 3, 4, 10, 60]) for _ in range(draw.choice([1, 3, 8]))]
    return [{"kind": kind, "at_s": _at(draw), "count": count} for count in counts]


def _lasting(kind: str, *lengths_s: float, **more: Any) -> Callable[[random.Random], Faults]:
    def drawn(draw: random.Random) -> Faults:
        return [{"kind": kind, "at_s": _at(draw), "duration_s": draw.choice(lengths_s), **more}]

    return drawn


SET_BY_S = [-3600.0, 3600.0, 0.5, -0.5, 0.06, -0.03, -0.04, -0.06, -0.08, -0.1, 0.02, 0.04, 0.1]
"""By how much a clock is set: by hours, and by a few fields, which pass for fields lost or numbered twice."""


def _set_while_frozen(draw: random.Random) -> Faults:
    at_s, length_s = _at(draw), draw.choice([0.1, 0.2, 0.3, 0.5])
    return [
        {"kind": "freeze", "at_s": at_s, "duration_s": length_s},
        {"kind": "clock_step", "at_s": round(at_s + length_s / 2, 2), "by_s": draw.choice(SET_BY_S)},
    ]


KINDS: dict[str, Callable[[random.Random], Faults]] = {
    "fields lost on the bus": lambda draw: _losses(draw, "lose"),
    "fields lost, not counted by the driver": lambda draw: _losses(draw, "lose_silently"),
    "program frozen": _lasting("freeze", 0.06, 0.1, 0.3, 0.9, 3.0, 12.0),
    "computer busy": lambda draw: [
        {"kind": "busy", "at_s": _at(draw), "duration_s": 3.0, "mean_ms": draw.choice([10, 30, 100])}
    ],
    "fields arrive in a burst": _lasting("bunch", 0.06, 0.1, 0.2, 0.5),
    "timestamp clock set": lambda draw: [
        {"kind": "clock_step", "at_s": _at(draw), "by_s": draw.choice(SET_BY_S)}
    ],
    "timestamp clock set while the program is frozen": _set_while_frozen,
    "timestamps zero": _lasting("timestamp", 0.02, 0.1, 2.0, says="zero"),
    "timestamps backward": _lasting("timestamp", 0.02, 0.1, 0.5, says="backward"),
    "camera in the other phase": lambda draw: [{"kind": "turn", "at_s": _at(draw)}],
    "driver's count restarts": lambda draw: [{"kind": "recount", "at_s": _at(draw)}],
    "stall": _lasting("stall", 0.3, 2.0),
    "stream fails": _lasting("fail", 0.1, until="time"),
    "unplugged": lambda draw: [
        {"kind": "unplug", "at_s": _at(draw), "back_after_s": draw.choice([0.1, 1.0])}
    ],
    "no signal, reported": _lasting("no_signal", 0.3, 1.0),
    "timestamps late": lambda draw: [],
    "computer overloaded from the start": lambda draw: [
        {
            "kind": "busy",
            "at_s": 0.0,
            "duration_s": round(draw.uniform(0.5, 6.0), 2),
            "mean_ms": draw.choice([60, 150, 400]),
        }
    ],
}


BUSY, FEW_FIELDS_S = ("computer busy", "computer overloaded from the start"), 0.2
"""While every field waits and some are lost, a clock that is set by a few fields passes for as many lost ones
more or less, until a field arrives in time: nothing tells them apart, and it is left out."""


def drawn(seed: int) -> Case:
    """The case of a seed: up to three kinds of faults, any driver, any camera and capture."""
    draw = random.Random(seed)
    kinds = tuple(draw.sample(list(KINDS), draw.choice([1, 1, 2, 3])))
    order = draw.choice(["alternate", "alternate", "top_first", "bottom_first"])
    if "camera in the other phase" in kinds:
        order = "alternate"  # what weaves frames waits for the field that it begins with
    driver = {
        "order": order,
        "stamps": draw.choice(["exposure", "exposure", "arrival"]),
        "counts": draw.choice(
            ["fields", "nothing", "frames"] if order == "alternate" else ["fields", "nothing"]
        ),
        "jitter_ms": draw.choice([0.5, 2.0, 6.0]),
    }
    if "computer busy" in kinds:  # the hardest: a queue that drains looks like losses
        driver["stamps"] = draw.choice(["exposure", "arrival", "arrival"])
    if "timestamps late" in kinds:
        driver |= {"late": draw.choice([0.003, 0.02, 0.1]), "late_ms": draw.choice([10.0, 25.0, 60.0])}
    faults = [fault for kind in kinds for fault in KINDS[kind](draw)]
    if any(kind in kinds for kind in BUSY):
        faults = [fault for fault in faults if not 0 < abs(fault.get("by_s", 0)) < FEW_FIELDS_S]
    start_s = draw.uniform(0.5, 3.0)
    return Case(
        seed=seed,
        kinds=kinds,
        driver=driver,
        buffers=draw.choice([4, 8, 16, 32]),
        faults=faults,
        start_s=start_s,
        stop_s=start_s + draw.uniform(2.0, 4.5),
        pre_fields=draw.choice([0, 0, 10, 25]),
        fields=draw.choice([None, None, 100]),
    )
