"""What a driver delivers to the kernel's own tool: which of the camera's fields are in a buffer's rows."""

import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from proofs.vm.guest import emulated
from proofs.vm.guest.shell import run
from proofs.vm.usb.camera import COLUMNS, PAL, WEBCAM, numbers_in

_TO = Path("/dev/shm/seen")
_LUMA = {"usbtv": 0, "stk1160": 1, "uvc": 0}
"""Of the bytes of a pixel."""


def seen(kind: str, faults: Sequence[Sequence[Any]], count: int = 40) -> list[str]:
    """Plugs a device in, has some of its fields harmed and reads it by `v4l2-ctl`.

    Args:
        kind: One of `proofs.vm.usb.__main__.KINDS`.
        faults: As `Emulated.script` takes them.
        count: Buffers to read.

    Returns:
        The tool's line on each buffer round the faults, and the numbers in its rows, counted from the first
        fault on: of a woven frame those of its top field, then those of its bottom field.
    """
    emulated.plug_in(kind)
    grabber = emulated.plugged[kind]
    is_woven = emulated.family(kind) != "uvc"
    if is_woven:
        run("v4l2-ctl -d /dev/video0 -s pal")
    how = f"--stream-mmap --stream-count={count} --stream-to={_TO} --verbose"
    reader = subprocess.Popen(
        ["v4l2-ctl", "-d", "/dev/video0", *how.split()],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    time.sleep(0.5)
    first = grabber("script", *faults)
    said, _ = reader.communicate(timeout=120)
    lines = [line.strip() for line in said.splitlines() if "dqbuf" in line]
    rows = 2 * PAL.lines if is_woven else WEBCAM.lines
    frames = np.fromfile(_TO, np.uint8).reshape(-1, rows, COLUMNS, 2)[..., _LUMA[emulated.family(kind)]]
    _TO.unlink()
    emulated.unplug(kind)
    found = []
    for line, frame in zip(lines, frames, strict=False):
        parts = [frame[0::2], frame[1::2]] if is_woven else [frame]
        numbers = [sorted({number - first for number in numbers_in(part)}) for part in parts]
        if -6 <= min(map(min, numbers)) <= 8:
            found.append(f"{line}: fields {numbers}")
    return found
