"""An archive measured again: fields a second over processes, and memory over many and over long captures."""

import os
import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from grabberd.archive.capture.meta import CaptureMeta
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.export.dataset import DataSet
from grabberd.config import default_config_file, load_config, shipped_configs
from grabberd.core.field import Field, NumberedField, double_lines, quantise
from grabberd.core.ledger import Ledger, Outcome, Slot
from grabberd.files.reading import read_documents
from grabberd.instrument.acquisition.device import GRABBERS
from grabberd_reprocess.reprocess_archive import (
    ReprocessProgress,
    ReprocessRequest,
    ReprocessSummary,
    reprocess_archive,
)
from grabberd_reprocess.reprocess_capture import CaptureTask, Recipe, reprocess_capture
from grabberd_reprocess.workers import local_workers

from .daemon import resident_mb

PERIOD, PERIOD_NS, THRESHOLD = 50, 20_000_000, 60
MANY, SMALL = 1000, 2
SCALING, MEDIUM, ROUNDS = 16, 300, 3
LONG = 1500


@dataclass
class Run:
    """One data set's making: what it cost, and the memory meanwhile."""

    summary: ReprocessSummary
    processor_s: float
    parent_mb: list[float] = field(default_factory=list)
    workers_mb: list[float] = field(default_factory=list)
    highest_mb: float = 0.0


def table() -> str:
    """The figures as Markdown."""
    with tempfile.TemporaryDirectory() as name:
        return "\n".join(_rows(Path(name)))


def _rows(folder: Path) -> Iterator[str]:
    fields = _fields()
    _archive(folder / "medium", fields, SCALING, MEDIUM)
    rounds = [(_run(folder, "medium", 1, n), _run(folder, "medium", 2, n)) for n in range(ROUNDS)]
    yield f"{SCALING} captures of {MEDIUM} fields, 1 bit, doubled; processes at niceness 10."
    yield f"Medians of {ROUNDS} rounds by turns, and from the least to the greatest.\n"
    yield "| processes | fields/s | fields a second of processor time | ratio | MB, each process at most |"
    yield "|---|---|---|---|---|"
    for place, workers in enumerate((1, 2)):
        runs = [one[place] for one in rounds]
        rates = _spread([run.summary.fields_per_s for run in runs], ".0f")
        busy = _spread([run.summary.fields / run.processor_s for run in runs], ".0f")
        ratios = [one[place].summary.fields_per_s / one[0].summary.fields_per_s for one in rounds]
        highest = max(run.highest_mb for run in runs)
        yield f"| {workers} | {rates} | {busy} | {_spread(ratios, '.2f')} | {highest:.0f} |"
    yield f"\nOne capture of {LONG} fields in this process, read and written; the least of {ROUNDS} turns.\n"
    yield "| | fields a second of processor time |"
    yield "|---|---|"
    alone = {"a liner that opens and closes": fields, "a liner at rest": fields[:1]}
    for words, rate in _rates(folder, alone).items():
        yield f"| {words} | {rate:.0f} |"
    yield f"\nMB, one process: {MANY} captures of {SMALL} fields, and one of {LONG}.\n"
    yield "| | it that asks, at a quarter / the end | it that measures | at most | processor, ms a field |"
    yield "|---|---|---|---|---|"
    for words, name, captures, length in (
        (f"{MANY} captures", "many", MANY, SMALL),
        (f"{LONG} fields", "long", 1, LONG),
    ):
        _archive(folder / name, fields, captures, length)
        run = _run(folder, name, 1, 0)
        cost_ms = 1000 * run.processor_s / run.summary.fields
        sizes = f"{_course(run.parent_mb)} | {_course(run.workers_mb)} | {run.highest_mb:.0f}"
        yield f"| {words} | {sizes} | {cost_ms:.2f} |"
    yield f"\nThe machine's load meanwhile ({os.cpu_count()} processors): {os.getloadavg()[1]:.0f}."


def _rates(folder: Path, kinds: dict[str, list[Field]]) -> dict[str, float]:
    """Fields a second of processor time, without a process's start."""
    rates = dict.fromkeys(kinds, 0.0)
    for number, fields in enumerate(kinds.values()):
        _archive(folder / f"alone-{number}", fields, 1, LONG)
    for turn in range(ROUNDS):
        for number, words in enumerate(kinds):
            task = _task(folder / f"alone-{number}", folder / f"alone-{number}-{turn}")
            before_s = time.process_time()
            result = reprocess_capture(task)
            assert result.state == "measured", result.problem
            rates[words] = max(rates[words], result.fields / (time.process_time() - before_s))
    return rates


def _task(captures: Path, out: Path) -> CaptureTask:
    configs = shipped_configs()
    documents = read_documents(configs / "fake.calibration.json", configs / "objects" / "liner.yaml")
    (capture,) = captures.iterdir()
    with DataSet(out) as dataset:
        recipe = Recipe(dataset.keep(documents["calibration"]), dataset.keep(documents["object"]))
        return CaptureTask(
            capture, "barn", out / "0.parquet", out / "0.part", dataset.made_with, recipe, LONG
        )


def _spread(values: list[float], form: str) -> str:
    return f"{median(values):{form}} ({min(values):{form}} … {max(values):{form}})"


def _run(folder: Path, name: str, workers: int, number: int) -> Run:
    configs = shipped_configs()
    out = folder / f"{name}-{workers}-{number}"
    request = ReprocessRequest(
        [str(folder / name)], out, configs / "fake.calibration.json", configs / "objects" / "liner.yaml"
    )
    run = Run(ReprocessSummary(), 0.0)

    def look(_: ReprocessProgress) -> None:
        run.parent_mb.append(resident_mb())
        now_mb = list(_children_mb("VmRSS"))
        if now_mb:
            run.workers_mb.append(max(now_mb))
        run.highest_mb = max([run.highest_mb, *_children_mb("VmHWM")])

    before = _processor_s()
    run.summary = reprocess_archive(request, lambda _: local_workers(workers), look)
    run.processor_s = _processor_s() - before
    assert not run.summary.refused, run.summary.refused[0]
    return run


def _course(sizes_mb: list[float]) -> str:
    return f"{sizes_mb[len(sizes_mb) // 4]:.1f} / {sizes_mb[-1]:.1f}"


def _processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _children_mb(name: str) -> Iterator[float]:
    for pid in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        status = Path(f"/proc/{pid}/status")
        if status.exists():
            found = [line.split()[1] for line in status.read_text().splitlines() if line.startswith(name)]
            yield from (int(kib) * 1024 / 1e6 for kib in found)


def _fields() -> list[Field]:
    """One pulsation cycle, which can be repeated."""
    grabber = GRABBERS.create("fake", {"pace": "free"})
    grabber.open()
    fields: list[Field] = []
    while len(fields) < PERIOD:
        with grabber.dequeue(1.0) as some:
            fields += [Field.intact(one.field.luma.copy(), one.field.parity) for one in some]
    grabber.close()
    return fields[:PERIOD]


def _archive(folder: Path, fields: list[Field], captures: int, length: int) -> None:
    folder.mkdir()
    packed = [quantise(double_lines(one), 1, THRESHOLD) for one in fields]
    device = load_config(default_config_file()).devices["simulated"].model_dump(mode="json")
    for number in range(captures):
        meta = CaptureMeta(
            id=f"capture-{number:04d}",
            created_utc=f"2026-03-{1 + number % 28:02d}T09:30:00.000Z",
            start_ns=0,
            device={"name": "teatcup", "stream": {"live": True}},
            config=device,
            site={"barn": f"barn {number % 2}"},
            labels={"cow": str(number % 100)},
            note="",
            bits=1,
            lines="doubled",
            rate_hz=50.0,
            version="bench",
        )
        writer = CaptureWriter.create(folder / f"{meta.id}.grab.part", meta)
        ledger = Ledger()
        for n in range(length):
            numbered = NumberedField(n, n * PERIOD_NS, n, packed[n % len(packed)])
            writer.append([Slot(numbered, n, Outcome.RECEIVED, None, (), numbered.time_ns)])
            ledger.enter(n, Outcome.RECEIVED, None, ())
        writer.seal(ledger, complete=True, ended_because="length reached")
