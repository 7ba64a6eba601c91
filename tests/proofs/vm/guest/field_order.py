"""`grabberd devices --check-field-order` on the kernel's test device, whose pattern moves and pauses."""

import json
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

from proofs.vm.guest import vivid

TEXT = "devices: {{vivid: {{driver: v4l2, options: {options}}}}}\n"


def checked(**options: Any) -> dict[str, Any]:
    """What the command says, as JSON."""
    file = Path(tempfile.mkdtemp(dir="/dev/shm")) / "vivid.yaml"
    file.write_text(TEXT.format(options={"device": vivid.CAPTURE, "input": vivid.S_VIDEO, **options}))
    command = "from grabberd.cli import main; main()"
    arguments = ("devices", "--check-field-order", "vivid", "--json", "--config", str(file))
    vivid.set_controls(test_pattern=4, osd_text_mode=2, horizontal_movement=4)
    over = threading.Event()
    mover = threading.Thread(target=_move_and_pause, args=(over,))
    mover.start()
    try:
        done = subprocess.run(
            [sys.executable, "-c", command, *arguments], capture_output=True, text=True, check=False
        )
    finally:
        over.set()
        mover.join()
    try:
        said: dict[str, Any] = json.loads(done.stdout)
    except ValueError:
        raise RuntimeError(done.stdout + done.stderr) from None
    return said


def _move_and_pause(over: threading.Event) -> None:
    movement = 4
    while not over.wait(0.8):
        movement = 3 if movement == 4 else 4
        vivid.set_controls(horizontal_movement=movement)
