"""Where a field's time goes: `python -m tests.proofs.bench.hot_path [--fields N] [--functions N]`.

The stages are timed in `measure_fields` itself, the functions in a second pass by cProfile, which makes many
small calls look dearer than they are.
"""

import argparse
import cProfile
import io
import pstats
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import cv2
import numpy as np
from tests.proofs.bench.peers.given import SETTLED, given

from grabberd.core.chain import locating
from grabberd.core.chain import measure as process
from grabberd.core.chain.engine import Engine
from grabberd.core.chain.measure import MeasureSetup, measure_fields
from grabberd.core.field import NumberedField
from grabberd.core.kernel import KERNEL, in_use
from grabberd.core.reconstruction import Tracker

STEPS: dict[str, tuple[Any, str]] = {
    "location": (locating, "measure"),
    "blobs of a view, both": (process, "whole_views"),
    "tracking and intersection": (Tracker, "step"),
}
ENGINE: dict[str, tuple[Any, str]] = {
    "inputs and room": (Engine, "_take"),
    "the kernel, bits to points": (KERNEL, "measure"),
}
STAGES = ENGINE if KERNEL else STEPS
"""Where a kernel does all in one call, `perf record` shows its functions."""


def main() -> None:
    """A table of the stages, then the functions of each kind of field."""
    parser = argparse.ArgumentParser(prog="python -m tests.proofs.bench.hot_path", description=__doc__)
    parser.add_argument("--fields", type=int, default=100)
    parser.add_argument("--functions", type=int, default=15, help="how many of the dearest are listed")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    scene = given(options.fields)
    print(f"Microseconds a field, medians of {options.fields}, by the {in_use()}.\n")
    print(table({name: stages_us(fields, scene.setup) for name, fields in scene.packed.items()}))
    for name, fields in scene.packed.items():
        print(f"\n{name}: functions by their own time\n\n{functions(fields, scene.setup, options.functions)}")


def table(rows: dict[str, dict[str, float]]) -> str:
    """Markdown, a row a kind of field."""
    names = [*STAGES, "the rest", "all"]
    head = [f"| field | {' | '.join(names)} |", "|---" * (len(names) + 1) + "|"]
    lines = [f"| {name} | {' | '.join(f'{took[one]:.0f}' for one in names)} |" for name, took in rows.items()]
    return "\n".join(head + lines)


def stages_us(fields: list[NumberedField], setup: MeasureSetup) -> dict[str, float]:
    """Medians over the settled fields."""
    taken: dict[str, list[float]] = {name: [] for name in [*STAGES, "all"]}
    with watched() as spent:
        results = measure_fields(iter(fields), setup)
        for _ in fields:
            spent.update(dict.fromkeys(STAGES, 0))
            before = time.thread_time_ns()
            next(results)
            taken["all"].append(time.thread_time_ns() - before)
            for name in STAGES:
                taken[name].append(spent[name])
    medians = {name: float(np.median(values[SETTLED:])) / 1000 for name, values in taken.items()}
    return medians | {"the rest": medians["all"] - sum(medians[name] for name in STAGES)}


@contextmanager
def watched() -> Iterator[dict[str, int]]:
    """Nanoseconds that the stages have spent, while the block lasts."""
    spent = dict.fromkeys(STAGES, 0)
    originals = {name: getattr(*where) for name, where in STAGES.items()}
    try:
        for name, where in STAGES.items():
            setattr(*where, _timed(originals[name], name, spent))
        yield spent
    finally:
        for name, where in STAGES.items():
            setattr(*where, originals[name])


def _timed(work: Callable[..., Any], name: str, spent: dict[str, int]) -> Callable[..., Any]:
    def timed(*arguments: Any, **named: Any) -> Any:
        before = time.thread_time_ns()
        try:
            return work(*arguments, **named)
        finally:
            spent[name] += time.thread_time_ns() - before

    return timed


def functions(fields: list[NumberedField], setup: MeasureSetup, count: int) -> str:
    """The dearest by their own time, of the settled fields."""
    results = measure_fields(iter(fields), setup)
    for _ in range(SETTLED):
        next(results)
    profile = cProfile.Profile(time.thread_time)
    profile.runcall(lambda: list(results))
    text = io.StringIO()
    pstats.Stats(profile, stream=text).strip_dirs().sort_stats("tottime").print_stats(count)
    return "\n".join(line for line in text.getvalue().splitlines() if line.strip())


if __name__ == "__main__":
    main()
