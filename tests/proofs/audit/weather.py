"""The weather: what cameras, drivers and computers do, and every pair of it, as a seed has it.

The rows come from the kernel's documentation of buffers, flags, field orders and streaming, and from the list
of faults that grabbers show; none of them was chosen for what the program does about it.
"""

import random
from collections.abc import Callable
from itertools import combinations_with_replacement
from typing import NamedTuple

from grabberd.core.field import FieldOrder

from .world import WOVEN, Loss, Span, Weather

Sets = Callable[[Weather, random.Random, float], object]
"""Sets weather of a run that lasts so many s."""


class Row(NamedTuple):
    """A row of the table: its weather, and what two rows cannot both have."""

    sets: Sets
    of: str = ""
    clear: bool = True


class Case(NamedTuple):
    """One run.

    Attributes:
        seed: Of everything that is drawn in it.
        names: Rows of the table.
        weather: What they make.
        start_s, stop_s: When the capture is asked for, and stopped.
        pre_fields: Fields before the request that are asked for.
        fields: Length that is asked for, or None.
    """

    seed: int
    names: tuple[str, ...]
    weather: Weather
    start_s: float
    stop_s: float
    pre_fields: int
    fields: int | None


def _is(**what: object) -> Sets:
    return lambda w, draw, s: vars(w).update(what)


def _one_of(name: str, *values: object) -> Sets:
    return lambda w, draw, s: setattr(w, name, draw.choice(values))


def _spans(name: str, shortest_s: float, longest_s: float, *amounts: float, most: int = 1) -> Sets:
    """Up to `most` spans, their lengths even on a scale of logarithms."""

    def sets(w: Weather, draw: random.Random, s: float) -> None:
        for _ in range(draw.randint(1, most)):
            at_s = draw.uniform(0.2, s)
            length_s = shortest_s * (longest_s / shortest_s) ** draw.random()
            getattr(w, name).append(Span(at_s, at_s + length_s, draw.choice(amounts or (0.0,))))

    return sets


def _busy_from_the_start(w: Weather, draw: random.Random, s: float) -> None:
    w.busy.append(Span(0.0, draw.uniform(0.5, 6.0), draw.choice([30, 60, 150, 400])))


def _lost(*of: str, counted: bool = True, lasts_s: tuple[float, float] = (0.02, 0.2), most: int = 4) -> Sets:
    def sets(w: Weather, draw: random.Random, s: float) -> None:
        for _ in range(draw.randint(1, most)):
            at_s, each = draw.uniform(0.2, s), draw.choice([2, 5, 7, 10, 25])
            span = Span(at_s, at_s + draw.uniform(*(min(lasts, s) for lasts in lasts_s)))
            lost = draw.randint(1, each // 2)
            w.losses.append(Loss(span, draw.choice(of), counted, lost, each, draw.randrange(10**6)))

    return sets


def _count_at(bits: int) -> Sets:
    def sets(w: Weather, draw: random.Random, s: float) -> None:
        w.wraps, w.restarts_at_0 = 2**bits, False
        w.first_count = max(2**bits - round(draw.uniform(0.3, s) * w.rate_hz / w.per_buffer), 0)
        w.counts = "fields" if w.counts == "nothing" else w.counts

    return sets


def _uncounted(w: Weather, draw: random.Random, s: float) -> None:
    w.counts = "fields"
    _lost("all", "some of each", counted=False)(w, draw, s)


def _off(name: str, *ppm: float) -> Sets:
    return lambda w, draw, s: setattr(w, name, draw.choice(ppm) * draw.choice([-1, 1]))


def _late(w: Weather, draw: random.Random, s: float) -> None:
    w.late, w.late_ms = draw.choice([0.003, 0.02, 0.1]), draw.choice([10.0, 25.0, 60.0])


SET_BY_S = (-3600.0, 3600.0, 0.5, -0.5, 0.06, -0.03, -0.04, -0.08, -0.1, 0.02, 0.04, 0.1)

ROWS: dict[str, Row] = {
    "stamps of the start of exposure (SOE)": Row(_is(source="soe"), "source"),
    "stamps taken as the program dequeues": Row(_is(source="read"), "source"),
    "stamps copied (TIMESTAMP_COPY)": Row(_is(source="copy"), "source"),
    "stamps of unknown clock, zero": Row(_is(source="unknown"), "source"),
    "stamps on a grid of 1 ms": Row(_is(grid_ms=1.0), "grid"),
    "stamps on a grid of 4 ms": Row(_is(grid_ms=4.0), "grid"),
    "stamps on a grid of 10 ms": Row(_is(grid_ms=10.0), "grid"),
    "stamps on a grid of 16.67 ms": Row(_is(grid_ms=16.667), "grid"),
    "stamps by a clock of another rate": Row(_off("clock_ppm", 50, 200, 500)),
    "some stamps late": Row(_late, clear=False),
    "stamps zero for a time": Row(_spans("zeros", 0.02, 3.0), clear=False),
    "stamps backward for a time": Row(_spans("backs", 0.02, 1.0), clear=False),
    "clock of the stamps set": Row(_spans("steps", 0.1, 0.2, *SET_BY_S), "steps", clear=False),
    "batches of 8 ms on USB": Row(_is(usb_ms=8.0)),
    "short shutter": Row(_one_of("shutter", 0.02, 0.2, 0.5)),
    "no count of losses": Row(_is(counts="nothing"), "count"),
    "every buffer counted": Row(_is(counts="fields"), "count"),
    "both fields of a frame share a count": Row(
        _is(counts="frames", order=FieldOrder.ALTERNATE, rate_hz=50.0), "count"
    ),
    "count wraps at 16 bits": Row(_count_at(16), "wrap"),
    "count wraps at 32 bits": Row(_count_at(32), "wrap"),
    "count begins anew": Row(_spans("recounts", 0.1, 0.2, most=2), clear=False),
    "count goes on over STREAMON": Row(_is(restarts_at_0=False, first_count=1000)),
    "losses that are not counted": Row(_uncounted, "count"),
    "camera off by 50 to 200 ppm": Row(_off("ppm", 50, 100, 200), "rate"),
    "camera off by 1000 to 5000 ppm": Row(_off("ppm", 1000, 2000, 4000, 5000), "rate"),
    "camera warms up": Row(_off("warm_ppm", 50, 200, 1000), "warm"),
    "camera wanders": Row(_off("wander_ppm", 50, 200, 1000), "wander"),
    "freeze below a second": Row(_spans("freezes", 0.06, 1.0, most=3), clear=False),
    "freeze of seconds": Row(_spans("freezes", 1.0, 30.0), clear=False),
    "whole computer stands": Row(_spans("stands", 0.06, 3.0, most=3), clear=False),
    "busy for seconds": Row(_spans("busy", 0.5, 6.0, 10, 30, 100), clear=False),
    "busy for moments": Row(_spans("busy", 0.05, 0.5, 30, 100, 300, most=8), clear=False),
    "busy from the start": Row(_busy_from_the_start, clear=False),
    "single losses": Row(_lost("all", lasts_s=(0.01, 0.05))),
    "losses in bursts": Row(_lost("all", "at random", lasts_s=(0.1, 1.5))),
    "periodic losses": Row(_lost("some of each", lasts_s=(1.0, 120.0), most=2)),
    "losses of one parity": Row(_lost("one parity", lasts_s=(0.1, 2.0), most=2)),
    "losses at random": Row(_lost("at random", lasts_s=(2.0, 60.0), most=1)),
    "held back by a hub": Row(_spans("bunches", 0.05, 0.5, most=3), clear=False),
    "silence": Row(_spans("stalls", 0.1, 4.0), clear=False),
    "stream fails": Row(_spans("fails", 0.01, 2.0), clear=False),
    "unplugged": Row(_spans("unplugged", 0.1, 5.0), clear=False),
    "no signal": Row(_spans("dark", 0.2, 3.0), clear=False),
    "buffers flagged as damaged": Row(_one_of("flagged", 0.003, 0.05)),
    "old pictures again": Row(_one_of("repeated", 0.003, 0.03)),
    "buffers handed over twice": Row(_one_of("twice", 0.002, 0.01), clear=False),
    "buffers swapped": Row(_one_of("swapped", 0.01, 0.1), clear=False),
    "computer suspended": Row(_spans("suspends", 0.1, 0.2, -0.3, -0.2, 0.1, 0.3), clear=False),
    "camera in the other phase": Row(_spans("turns", 0.1, 0.2), clear=False),
}
"""Every pair of them comes in turn, and each alone."""


def can_meet(a: str, b: str) -> bool:
    """True if a run can have both rows."""
    return a == b or not ROWS[a].of or ROWS[a].of != ROWS[b].of


PAIRS = [pair for pair in combinations_with_replacement(ROWS, 2) if can_meet(*pair)]
_STRIDE = 449
"""Prime: all pairs come in as many seeds as there are pairs, and a few seeds have rows of all kinds."""
BUSY = ("busy for seconds", "busy for moments", "busy from the start")
FEW_FIELDS_S = 0.2
"""While every field waits and some are lost, a clock that is set by a few fields passes for as many lost ones
more or less, until a field arrives in time: nothing tells them apart, and it is left out."""


def drawn(seed: int) -> Case:
    """The case of a seed: its pair of rows, perhaps a third, before any stream, camera and capture."""
    draw = random.Random(seed)
    pair = PAIRS[seed * _STRIDE % len(PAIRS)]
    others = [name for name in ROWS if all(can_meet(name, one) for one in pair)]
    names = tuple(dict.fromkeys((*pair, *draw.sample(others, draw.choice([0, 1])))))
    weather, length_s = _base(draw), draw.choice([8.0, 12.0, 20.0, 40.0])
    if any(ROWS[name].of in ("rate", "warm", "wander") for name in names):
        length_s *= draw.choice([1, 3, 5])
    for name in names:
        ROWS[name].sets(weather, draw, length_s)
    _make_possible(weather, names)
    longest_s = max(
        (one.end_s for one in (*weather.freezes, *weather.stands, *weather.unplugged)), default=0.0
    )
    start_s = draw.uniform(0.3, 4.0)
    stop_s = max(length_s, draw.choice([0.0, longest_s + 3.0]), start_s + 2.0)
    fields = draw.choice([None, None, round((stop_s - start_s) * weather.rate_hz / 2)])
    return Case(seed, names, weather, start_s, stop_s, draw.choice([0, 0, 10, 25]), fields)


def _base(draw: random.Random) -> Weather:
    order = draw.choice([*WOVEN, FieldOrder.ALTERNATE, FieldOrder.ALTERNATE])
    rate_hz = draw.choice([50.0, 50.0, 50.0, 60_000 / 1001])
    if draw.random() < 0.15:
        order, rate_hz = FieldOrder.PROGRESSIVE, draw.choice([25.0, 30.0, 60.0])
    weather = Weather(order, rate_hz, ppm=draw.choice([0.0, 0.0, 20.0, -60.0]))
    counted = "frames" if order is FieldOrder.ALTERNATE else "fields"
    weather.counts = draw.choice(["nothing", "fields", counted])
    weather.usb_ms, weather.buffers = draw.choice([0.2, 0.5, 3.0]), draw.choice([4, 8, 16, 32])
    weather.shutter = draw.choice([1.0, 1.0, 0.3])
    weather.first_count = draw.choice([0, 1, 12345])
    return weather


def _make_possible(weather: Weather, names: tuple[str, ...]) -> None:
    """Leaves out what cannot be, and what nothing could tell apart."""
    if weather.turns:  # what weaves frames waits for the field that it begins with
        weather.order, weather.rate_hz = FieldOrder.ALTERNATE, 50.0
    if any(name in BUSY for name in names):
        weather.steps = [one for one in weather.steps if abs(one.amount) >= FEW_FIELDS_S]
    weather.clear = all(ROWS[name].clear for name in names)
