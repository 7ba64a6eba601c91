"""The offset of a logger's clock through a light, against the simulator's truth."""

from collections.abc import Iterator
from dataclasses import asdict
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake import FakeLight, JumpingClock
from grabberd_fake.light_options import LightOptions, lit, share_lit
from grabberd_liner.analysis.vacuum.light_clock import LightClock, LightSignal, relate_clocks, steady_times

SEEDS = 24
FIELD_NS = 20_000_000
EXPOSURE_NS = 1_000_000
OFFSET_S = 1.234


class Case(NamedTuple):
    """What camera and logger are like.

    Attributes:
        seconds: length of the capture; `rate_hz`: readings a second.
        scatter_s: σ of a field's time.
        threshold: share of an exposure from which on a field counts as lit.
        bracket_ms: longest time that a switching of the daemon's own takes; None: a logger records it.
    """

    seconds: int
    rate_hz: float
    scatter_s: float
    threshold: float
    bracket_ms: float | None = None


CASES = (
    Case(12, 1000.0, 0.0, 0.5),
    Case(30, 1000.0, 0.0, 0.5),
    Case(60, 1000.0, 0.0, 0.5),
    Case(60, 1000.0, 0.0, 0.1),
    Case(60, 1000.0, 1e-3, 0.5),
    Case(60, 100.0, 0.0, 0.5),
    Case(60, 100.0, 1e-3, 0.5),
    Case(30, 100.0, 0.0, 0.5, 0.05),
    Case(60, 100.0, 0.0, 0.5, 0.05),
    Case(60, 100.0, 0.0, 0.5, 1.0),
    Case(60, 100.0, 1e-3, 0.5, 1.0),
    Case(60, 100.0, 0.0, 0.5, 5.0),
)


def table() -> str:
    """Error of offset and drift over many patterns, and whether σ told it."""
    rows = [
        f"{SEEDS} patterns each; a clock that drifts by 5 · 10⁻⁵ (σ).",
        "",
        "| capture, s | recorded by | scatter of the fields' times, ms | counts as lit from |"
        " switchings |"
        " offset, RMS / σ (χ²), ms | drift, RMS / σ (χ²), 10⁻⁶ |",
        "|---|---|---|---|---|---|---|",
    ]
    return "\n".join([*rows, *map(_row, CASES)])


def _row(case: Case) -> str:
    found = list(_found(case))
    offset = [(one.offset_s - OFFSET_S, one.offset_sigma_s) for one, _ in found]
    drift = [(one.drift - true, one.drift_sigma) for one, true in found]
    edges = np.mean([one.edges for one, _ in found])
    return (
        f"| {case.seconds} | {_recorder(case)} | {case.scatter_s * 1e3:g} | {case.threshold:.0%} of 1 ms |"
        f" {edges:.0f} | {_words(offset, 1e3)} | {_words(drift, 1e6)} |"
    )


def _recorder(case: Case) -> str:
    if case.bracket_ms is None:
        return f"a logger, {case.rate_hz:.0f} readings a second"
    return f"the daemon that switches it, within {case.bracket_ms:g} ms at most"


def _words(pairs: list[tuple[float, float]], scale: float) -> str:
    error, sigma = np.array(pairs).T
    rms, told = np.sqrt(np.mean(error**2)) * scale, np.sqrt(np.mean(sigma**2)) * scale
    return f"{rms:.2g} / {told:.2g} ({np.mean((error / sigma) ** 2):.2f})"


def _found(case: Case) -> Iterator[tuple[LightClock, float]]:
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        light, drift = LightOptions(diameter_px=10.0, seed=seed), rng.normal(0, 5e-5)
        first_ns = int(rng.integers(10**12))
        fields_ns = first_ns + np.arange(case.seconds * 50) * FIELD_NS
        on = np.array([share_lit(light, time_ns, EXPOSURE_NS) for time_ns in fields_ns.tolist()])
        since_s = (fields_ns - first_ns) / 1e9
        stamped_s = since_s + rng.normal(0, case.scatter_s, len(since_s))
        seen = LightSignal(steady_times(np.arange(len(on)), stamped_s), on > case.threshold)
        read_s, states = _recorded(case, light, first_ns, rng)
        middle_s = since_s[[0, -1]].mean()
        own_s = read_s - OFFSET_S - drift * (read_s - middle_s)
        yield relate_clocks(seen, LightSignal(own_s, states)), drift


def _recorded(
    case: Case, light: LightOptions, first_ns: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Times and states of the readings, in seconds of the camera from the first field on."""
    if case.bracket_ms is None:
        read_s = np.arange(-3 + rng.uniform(0, 1 / case.rate_hz), case.seconds + 3, 1 / case.rate_hz)
        return read_s, lit(light, first_ns + np.rint(read_s * 1e9).astype(np.int64))
    clock = JumpingClock()
    clock.sleep_until_ns(first_ns - 3 * 10**9)
    seed = int(rng.integers(2**32))
    switch = FakeLight(clock=clock, light=asdict(light), bracket_ms=case.bracket_ms, seed=seed)
    switch.open()
    parts = []
    while clock.now_ns() < first_ns + (case.seconds + 3) * 10**9:
        parts.append(switch.read(1.0))
    time_ns = np.concatenate([part.time_ns for part in parts])
    return (time_ns - first_ns) / 1e9, np.concatenate([part.values[:, 0] for part in parts]) > 0
