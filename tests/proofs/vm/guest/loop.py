"""Pictures of our own, through the kernel and out of the driver."""

import itertools
import time
from typing import Any

import numpy as np

from grabberd_fake.stamp import read_stamp
from grabberd_v4l2 import V4l2Grabber
from proofs.vm.guest import vivid

FILM = "/dev/shm/film"
PHASES = 8


def seen(frames: int, film_frames: int, **options: Any) -> dict[str, Any]:
    """Plays a film of stamped noise and compares every pixel of every field that the driver delivers.

    Player and grabber both tick at 25 Hz; where both tick at once, a frame may be shown twice and the next
    one never. So the player is started again, some milliseconds later, until none is.
    """
    vivid.write_stamped_frames(FILM, film_frames)
    expected = [vivid.stamped_field(number) for number in range(2 * film_frames)]
    result: dict[str, Any] = {}
    for phase in range(PHASES):
        vivid.play(FILM)
        time.sleep(0.3 + 0.007 * phase)
        result = {"phase": phase, **_seen(frames, expected, options)}
        vivid.stop_playing()
        if not result["out_of_step"]:
            break
    return result


def _seen(frames: int, expected: list[np.ndarray], options: dict[str, Any]) -> dict[str, Any]:
    grabber = V4l2Grabber(device=vivid.CAPTURE, **options)
    numbers: list[int] = []
    wrong = strange_parity = 0
    try:
        info = grabber.open()
        while len(numbers) < 2 * frames:
            with grabber.dequeue(1.0) as fields:
                assert fields, "no field came"
                for grabbed in fields:
                    stamp = read_stamp(grabbed.field.luma)
                    number = -1 if stamp is None else stamp.number
                    wrong += number < 0 or not np.array_equal(grabbed.field.luma, expected[number])
                    strange_parity += stamp is None or stamp.parity != grabbed.field.parity
                    numbers.append(number)
    finally:
        grabber.close()
    return {
        "granted": f"{info.field_order} {info.pixel_format}",
        "fields": len(numbers),
        "wrong": int(wrong),
        "strange_parity": int(strange_parity),
        "out_of_step": sum((b - a) % len(expected) != 1 for a, b in itertools.pairwise(numbers)),
    }
