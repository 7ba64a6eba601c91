"""An archive measured again: fields a second over processes, and memory over many and over long captures."""

import os
import resource
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from grabberd.acquisition import Ledger, Outcome, Slot
from grabberd.acquisition.registry import create
from grabberd.config import default_config_file, load_config, shipped_configs
from grabberd.field import Field, NumberedField, double_lines, quantise
from grabberd.service.executors import local_workers
from grabberd.service.reprocess import Progress, Request, Summary, reprocess
from grabberd.storage import CaptureMeta, CaptureWriter

from .daemon import resident_mb

PERIOD, PERIOD_NS, THRESHOLD = 50, 20_000_000, 60
MANY, SMALL = 200, 2
SCALING, MEDIUM = 6, 100
LONG = 1500


@dataclass
class Run:
    """One data set's making: what it cost, and the highest memory."""

    summary: Summary
    processor_s: float
    parent_mb: list[float] = field(default_factory=list)
    worker_mb: float = 0.0


def table() -> str:
    """The figures as Markdown."""
    with tempfile.TemporaryDirectory() as name:
        return "\n".join(_rows(Path(name)))


def _rows(folder: Path) -> Iterator[str]:
    fields = _fields()
    _archive(folder / "medium", fields, SCALING, MEDIUM)
    one, two = (_run(folder, "medium", workers) for workers in (1, 2))
    yield f"{SCALING} captures of {MEDIUM} fields, 1 bit, doubled; processes at niceness 10.\n"
    yield "| processes | fields/s | fields a second of processor time | ratio | MB, each process at most |"
    yield "|---|---|---|---|---|"
    for workers, run in ((1, one), (2, two)):
        ratio = run.summary.fields_per_s / one.summary.fields_per_s
        rates = f"{run.summary.fields_per_s:.0f} | {run.summary.fields / run.processor_s:.0f}"
        yield f"| {workers} | {rates} | {ratio:.2f} | {run.worker_mb:.0f} |"
    yield f"\nMB, one process: {MANY} captures of {SMALL} fields, and one of {LONG}.\n"
    yield "| | it that asks, at a quarter / at the end | it that measures, at most | processor, ms a field |"
    yield "|---|---|---|---|"
    for words, name, captures, length in (
        (f"{MANY} captures", "many", MANY, SMALL),
        (f"{LONG} fields", "long", 1, LONG),
    ):
        _archive(folder / name, fields, captures, length)
        run = _run(folder, name, 1)
        quarter, end = run.parent_mb[len(run.parent_mb) // 4], run.parent_mb[-1]
        cost_ms = 1000 * run.processor_s / run.summary.fields
        yield f"| {words} | {quarter:.1f} / {end:.1f} | {run.worker_mb:.0f} | {cost_ms:.2f} |"
    yield f"\nThe machine's load meanwhile ({os.cpu_count()} processors): {os.getloadavg()[1]:.0f}."


def _run(folder: Path, name: str, workers: int) -> Run:
    configs = shipped_configs()
    out = folder / f"{name}-{workers}"
    request = Request(
        [str(folder / name)], out, configs / "fake.calibration.json", configs / "objects" / "liner.yaml"
    )
    run = Run(Summary(), 0.0)

    def look(_: Progress) -> None:
        run.parent_mb.append(resident_mb())
        run.worker_mb = max([run.worker_mb, *_children_mb()])

    before = _processor_s()
    run.summary = reprocess(request, lambda _: local_workers(workers), look)
    run.processor_s = _processor_s() - before
    assert not run.summary.refused, run.summary.refused[0]
    return run


def _processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _children_mb() -> Iterator[float]:
    for pid in Path(f"/proc/self/task/{os.getpid()}/children").read_text().split():
        status = Path(f"/proc/{pid}/status")
        if status.exists():
            highest = [
                line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmHWM")
            ]
            yield from (int(kib) * 1024 / 1e6 for kib in highest)


def _fields() -> list[Field]:
    """One pulsation cycle, which can be repeated."""
    grabber = create("fake", {"pace": "free"})
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
            numbered = NumberedField(n, n * PERIOD_NS, n, packed[n % PERIOD])
            writer.append([Slot(numbered, n, Outcome.RECEIVED, None, ())])
            ledger.enter(n, Outcome.RECEIVED, None, ())
        writer.seal(ledger, complete=True, ended_because="length reached")
