"""Four devices at 50 Hz in one daemon, all captured together, with a witness of the machine's own stalls.

What they deliver was rendered beforehand: to render four cameras would cost more than the daemon.
"""

import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import default_config_file, load_config
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service

from .daemon import Cost, resident_mb, served
from .live import SETTLE_S, in_words_ms
from .looped import LoopedGrabber, rendered
from .witness import Witness, witness

DEVICES = ("north", "east", "south", "west")
PICTURES = 200
KINDS = ("recorder", "writer", "capture", "worker", "threshold")


class _NoRendering:
    """There is none to take off."""

    cpu_s = 0.0


def table(seconds: float) -> str:
    """Runs it and gives the figures as Markdown tables."""
    with tempfile.TemporaryDirectory() as folder:
        devices, rows = measure(Path(folder), seconds)
    first = [
        "| device | due | ledger | points a field | arrived → published, p50 / p99 / max | ring, deepest |"
    ]
    first += ["|---|---|---|---|---|---|"]
    second = ["| | |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)]
    return "\n".join([*first, *(f"| {' | '.join(row)} |" for row in devices), "", *second])


def measure(folder: Path, seconds: float) -> tuple[list[tuple[str, ...]], list[tuple[str, str]]]:
    """One capture of each device, begun together; a row for each, and what it all cost."""
    service = Service(_setups(), folder)
    with served(service), witness() as watching:
        time.sleep(SETTLE_S)
        return _run(service, seconds, watching)


def _setups() -> Any:
    """The simulated grabber's configuration, four times, with other pictures' sources."""
    file = default_config_file()
    config = load_config(file)
    usual = config.devices["simulated"]
    setups = set_up(config.model_copy(update={"devices": dict.fromkeys(DEVICES, usual)}), file)
    pictures = rendered(PICTURES)
    step = PICTURES // len(DEVICES) // 2 * 2  # they do not pulsate alike
    return {
        name: replace(setup, grabber=LoopedGrabber(pictures, step * place))
        for place, (name, setup) in enumerate(setups.items())
    }


def _run(
    service: Service, seconds: float, watching: Witness
) -> tuple[list[tuple[str, ...]], list[tuple[str, str]]]:
    for one in service.instruments.values():
        with one.board.changed:
            one.board.changed.wait_for(lambda one=one: one.captures.accepts, 30.0)
    wanted = CaptureRequest(fields=round(seconds * 50))
    group_id = service.capture_control.start_group(dict.fromkeys(service.instruments, wanted))
    cost = Cost(_NoRendering())  # type: ignore[arg-type]
    captures = {name: one.captures for name, one in service.instruments.items()}
    recordings = {name: one.recording for name, one in captures.items() if one.recording}
    shares, highest_mb = cost.shares(), resident_mb()
    while all(recording.recorder.recording for recording in recordings.values()):
        shares, highest_mb = cost.shares(), max(highest_mb, resident_mb())
        time.sleep(min(1.0, seconds / 10))
    for recording in recordings.values():
        recording.sealed.wait(60)
    rows = [_row(service, service.instruments[name], recording) for name, recording in recordings.items()]
    return rows, [*_costs(_by_kind(shares)), *_about(service, group_id, watching, highest_mb)]


def _row(service: Service, instrument: Instrument, recording: Recording) -> tuple[str, ...]:
    with CaptureReader(service.archive.path(recording.id)) as reader:
        ledger, points = reader.ledger, sum(len(one) for _, one in reader.points())
    latency = instrument.worker.latency.milliseconds(ledger.total)
    return (
        instrument.name,
        str(ledger.total),
        ledger.in_words(50.0),
        f"{points / max(1, ledger.received):.1f}",
        in_words_ms(latency),
        f"{recording.recorder.reader.deepest} of {instrument.pipeline.ring.slots}",
    )


def _by_kind(shares: dict[str, float]) -> dict[str, float]:
    """Of all devices together, by what the threads do."""
    of = {"everything": shares["everything"]}
    for kind in KINDS:
        of[kind] = sum(share for name, share in shares.items() if name.startswith(kind))
    return of


def _costs(shares: dict[str, float]) -> list[tuple[str, str]]:
    everything = shares.pop("everything")
    threads = ", ".join(f"{kind} {share:.1%}" for kind, share in shares.items() if share)
    return [
        ("share of a core, all four, nothing rendered", f"{everything:.1%}"),
        ("of it by what the threads do", threads),
    ]


def _about(service: Service, group_id: str, watching: Witness, highest_mb: float) -> list[tuple[str, str]]:
    first_s = [one.first_field_s for one in service.capture_control.captures_of(group_id)]
    return [
        ("first fields after the common start", ", ".join(f"{1e3 * one:.1f} ms" for one in first_s)),
        ("lost by the drivers' buffers", str(sum(_lost(one) for one in service.instruments.values()))),
        ("resident memory, highest", f"{highest_mb:.0f} MB"),
        ("longest stall of the machine, seen by a witness", f"{watching.stalls.longest_s * 1e3:.0f} ms"),
        ("stalls over 20 ms that the witness saw", str(watching.stalls.long_ones)),
    ]


def _lost(instrument: Instrument) -> int:
    grabber = instrument.setup.grabber
    assert isinstance(grabber, LoopedGrabber)
    return grabber.lost
