"""A capture recorded by the command itself, where no daemon holds the device."""

import contextlib
import sys
import time
from pathlib import Path
from typing import Any

from rich.progress import BarColumn, Progress, TimeElapsedColumn

from grabberd.archive.capture.crash_recovery import interrupted_captures, recording_folder
from grabberd.archive.catalogue.capture_documents import describe
from grabberd.cli.options import end_as_ctrl_c_does, warn, with_device
from grabberd.cli.serve import SWITCH_INTERVAL_S
from grabberd.cli.terminal import progress_console
from grabberd.config import Config, default_config_file
from grabberd.documents.enums import DeviceState
from grabberd.documents.requests import NewCapture
from grabberd.errors import DeviceAbsent
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.channels.logger_setup import set_up_loggers
from grabberd.instrument.channels.loggers import Loggers
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.setup import set_up
from grabberd.runtime import SystemClock

POLL_S = 0.05
OPEN_TIMEOUT_S, STILL_OPENING_S = 10.0, 50.0
"""How long a device may take to deliver, and how much longer one that is not even open: a busy computer takes
that long to load a driver.
"""
CLOCK_SIGMA_NS, CLOCK_TIMEOUT_S = 1_000_000, 6.0
"""σ to which a logger's clock has to be known before the first field, and how long that may take.

A millisecond is .7 kPa while a pulsator switches. Two seconds of readings give it on a quiet computer; a
daemon, whose loggers run all the time, has it long before a capture.
"""
CLOCK_KNOWN_S = 0.5
"""Time for which it has been known: what is recorded begins before the first field, by `MARGIN_NS`."""


def capture_directly(
    config: Config,
    file: Path | None,
    device: str | None,
    options: dict[str, Any],
    out: Path,
    driver_options: dict[str, Any] | None = None,
) -> dict[str, Any]:
    """Open the device, record into a new file, and return the capture's document; Ctrl-C ends the capture.

    Args:
        config: The configuration.
        file: Where it was read from.
        device: Name of a device in it, or DRIVER:PATH.
        options: Options of the capture.
        out: File to write.
        driver_options: Options of the device's driver beside those of the configuration.

    Raises:
        DeviceAbsent: the device did not start to deliver.
        GrabberdError: the failure that ended the recording; the file is kept.
    """
    warn(
        f"{part} was left by an interrupted capture; 'grabberd storage seal {part}' recovers it"
        for part in interrupted_captures(out.parent)
    )
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    end_as_ctrl_c_does()
    chosen = with_device(config, file, device, driver_options)
    setup = next(iter(set_up(chosen, file or default_config_file()).values()))
    clock = SystemClock()
    loggers = Loggers(set_up_loggers(config, file or default_config_file()), clock)
    instrument = Instrument(
        setup, clock, site=dict(config.site), queue_s=config.storage.queue_s, loggers=loggers
    )
    loggers.start()
    instrument.start()
    try:
        _wait_until_it_accepts(instrument)
        warn(instrument.board.now.warnings)
        if config.loggers:
            _wait_for_clocks(loggers)
        request = NewCapture.model_validate(options).of_rate(instrument.pipeline.rate_hz)
        # In a hidden folder beside the output until it is sealed; the next run names what a crash left there.
        with recording_folder(out.parent) as folder:
            recording = instrument.start_capture(out.stem, request, folder / f"{out.name}.part")
            _follow(recording, request.fields)
            _keep(recording, out)
    finally:
        instrument.stop()
        loggers.stop()
    # A pin belongs to the state of a daemon, and there is none here.
    return describe(out).model_dump(mode="json", exclude={"pinned"})


def _wait_until_it_accepts(instrument: Instrument) -> None:
    board = instrument.board
    hopeless = (DeviceState.FAILED, DeviceState.ENDED)

    def decided() -> bool:
        return instrument.captures.accepts or board.state in hopeless

    with board.changed:
        is_decided = board.changed.wait_for(decided, OPEN_TIMEOUT_S)
        if not is_decided and board.state is DeviceState.OPENING and not board.now.openings:
            board.changed.wait_for(decided, STILL_OPENING_S)
    if not instrument.captures.accepts:
        cause = board.now.cause or "it has not delivered a field"
        raise DeviceAbsent(
            f"device {instrument.name} is {board.now.state}: {cause}",
            board.now.hint
            or "check the grabber and the configuration; 'grabberd devices' lists all grabbers",
        )


def _wait_for_clocks(loggers: Loggers) -> None:
    """Let loggers that were just opened relate their clocks to ours; one that cannot holds nothing up."""
    now_s = known_s = time.monotonic()
    end_s = now_s + CLOCK_TIMEOUT_S
    with progress_console.status("synchronising with the loggers' clocks"):
        while now_s < end_s and now_s - known_s < CLOCK_KNOWN_S:
            time.sleep(POLL_S)
            now_s = time.monotonic()
            known_s = now_s if loggers.unsettled(CLOCK_SIGMA_NS) else known_s
    warn(
        f"logger {name}: the times of its first readings are uncertain by more than "
        f"{CLOCK_SIGMA_NS / 1e6:g} ms; the analysis takes that into account"
        for name in loggers.unsettled(CLOCK_SIGMA_NS)
    )


def _follow(recording: Recording, wanted: int | None) -> None:
    """Show progress until the file is sealed; Ctrl-C ends the recording."""
    columns = ("recording", BarColumn(), "{task.completed} fields", TimeElapsedColumn())
    with Progress(*columns, console=progress_console, transient=True) as progress:
        task = progress.add_task("", total=wanted)
        # Ctrl-C only asks the recording to stop; the loop goes on until its file is sealed, so that a second
        # Ctrl-C cannot leave a file without its ledger.
        while not recording.sealed.is_set():
            with contextlib.suppress(KeyboardInterrupt):
                progress.update(task, completed=recording.recorder.ledger.total)
                recording.sealed.wait(POLL_S)
                continue
            recording.stop("stopped by the operator")


def _keep(recording: Recording, out: Path) -> None:
    """Rename the file, complete or not, then raise the failure that made it incomplete."""
    # First the file, then the error: what was recorded is kept even if the recording failed.
    recording.path.rename(out)
    if recording.failure is not None:
        raise recording.failure
