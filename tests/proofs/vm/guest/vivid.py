"""The kernel's virtual video device: loading it, its controls, pictures played into it."""

import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.stamp import Stamp, read_stamp, write_stamp
from proofs.vm.guest.shell import run, wait_for

CAPTURE, OUTPUT = "/dev/video0", "/dev/video1"
BY_PATH = "/dev/v4l/by-path/platform-vivid.0-video-index0"
"""The capture node, whatever its number."""
COLUMNS, LINES = 720, 576
S_VIDEO = 1
"""The input's number where there are a tuner (0) and an S-Video socket."""

_PATTERNS = "n_devs=1 node_types=0x1 num_inputs=2 input_types=0x9 ccs_cap_mode=0"
_CAMERA = "n_devs=1 node_types=0x1 num_inputs=2 input_types=0x8 ccs_cap_mode=0"
_LOOP = (
    "n_devs=1 node_types=0x101 num_inputs=1 input_types=2 num_outputs=1 output_types=0 "
    "ccs_cap_mode=0 ccs_out_mode=0"
)
_playing: list["subprocess.Popen[bytes]"] = []


def load_patterns() -> None:
    """A grabber with two inputs that draws test patterns; its timestamps are not of the future."""
    _load(_PATTERNS)
    set_controls(timestamp_source=1)


def load_camera() -> None:
    """A webcam with progressive pictures (input 0), and an S-Video socket (input 1)."""
    _load(_CAMERA, standard=None)
    set_controls(timestamp_source=1)


def load_everything() -> None:
    """A device with a node of every kind: output, radio, sliced text, metadata, touch."""
    _load("n_devs=1 num_inputs=2 input_types=0x9 node_types=0xe1d3d")


def show_picture() -> None:
    """What no check of a picture's content takes for anything else: squares that move a little."""
    set_controls(test_pattern=4, osd_text_mode=2, horizontal_movement=4)


def load_loop() -> None:
    """A grabber that sees, bit for bit, what is played into the output beside it."""
    _load(_LOOP)
    set_controls(timestamp_source=1, osd_text_mode=2, loop_video=1)
    for node, kind in ((CAPTURE, "v"), (OUTPUT, "x")):
        _set_format(node, kind)


def draws_patterns() -> bool:
    """Whether the device of `load_patterns` is there."""
    return os.path.exists(CAPTURE) and not os.path.exists(OUTPUT)


def unload() -> None:
    """Takes the device away."""
    stop_playing()
    run("lsmod | grep -q '^vivid' && modprobe -r vivid || true")


def set_controls(**controls: Any) -> None:
    """Sets controls of the capture node."""
    if controls:
        run(f"v4l2-ctl -d {BY_PATH} -c {','.join(f'{name}={value}' for name, value in controls.items())}")


def play(path: str) -> None:
    """Plays a file of woven frames round and round into the output, until `stop_playing`."""
    stop_playing()
    command = f"exec v4l2-ctl -d {OUTPUT} --stream-out-mmap --stream-from={path} --stream-loop"
    _playing.append(subprocess.Popen(["sh", "-c", f"{command} >/dev/null 2>&1"]))


def stop_playing() -> None:
    """Ends it."""
    while _playing:
        player = _playing.pop()
        player.kill()
        player.wait()


def unplug() -> None:
    """As pulling its plug does: the node is gone."""
    Path("/sys/bus/platform/drivers/vivid/unbind").write_text("vivid.0")


def plug_in() -> None:
    """Brings it back, under whatever node is free."""
    Path("/sys/bus/platform/drivers/vivid/bind").write_text("vivid.0")


def stamped_field(number: int) -> NDArray[np.uint8]:
    """Noise that is a function of the field's number, and a stamp of number and parity."""
    noise = np.random.default_rng(number).integers(0, 256, (LINES // 2, COLUMNS), dtype=np.uint8)
    write_stamp(noise, Stamp(number, number % 2))
    return noise


def write_stamped_frames(path: str, frames: int) -> None:
    """A film of woven frames; field 2k is the top field of frame k, 2k + 1 its bottom field."""
    with open(path, "wb") as file:
        for frame in range(frames):
            woven = np.empty((LINES, COLUMNS), np.uint8)
            woven[0::2], woven[1::2] = stamped_field(2 * frame), stamped_field(2 * frame + 1)
            file.write(woven.tobytes())


def grabbed_by_v4l2_ctl(count: int, film_frames: int) -> dict[str, Any]:
    """Plays a film, grabs it with the kernel's own tool and compares every pixel."""
    write_stamped_frames("/dev/shm/film", film_frames)
    play("/dev/shm/film")
    many = f"--stream-mmap --stream-skip=5 --stream-count={count}"
    run(f"v4l2-ctl -d {CAPTURE} {many} --stream-to=/dev/shm/seen")
    stop_playing()
    seen = np.fromfile("/dev/shm/seen", np.uint8).reshape(-1, LINES, COLUMNS)
    os.unlink("/dev/shm/seen")
    return {
        "frames": len(seen),
        "numbers": [_number_if_exact(rows) for f in seen for rows in (f[0::2], f[1::2])],
    }


def _number_if_exact(rows: NDArray[np.uint8]) -> int | None:
    stamp = read_stamp(rows)
    exact = stamp is not None and np.array_equal(rows, stamped_field(stamp.number))
    return stamp.number if exact and stamp else None


def _load(options: str, standard: str | None = "pal") -> None:
    unload()
    run(f"modprobe vivid {options}")
    wait_for(lambda: os.path.exists(CAPTURE))
    run("udevadm settle")
    if standard:
        run(f"v4l2-ctl -d {CAPTURE} -s {standard}")


def _set_format(node: str, kind: str) -> None:
    form = f"width={COLUMNS},height={LINES},pixelformat=GREY,field=interlaced"
    run(f"v4l2-ctl -d {node} -s pal {'--set-fmt-video' if kind == 'v' else '--set-fmt-video-out'} {form}")
