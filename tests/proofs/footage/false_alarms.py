"""How often the judgement of repetitions errs: genuine fields called repeated, and repeats not found."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.repeats import RepeatJudge
from grabberd.core.field import Field, quantise, split_frame, unpack
from grabberd.core.measurement import ThresholdRule, choose_threshold
from grabberd.instrument.acquisition import REPEATED, GrabbedField
from grabberd_fake import FakeGrabber, JumpingClock
from grabberd_replay.footage import RepeatMarks
from grabberd_replay.video import decoding
from proofs.footage.containers import ffmpeg_grey

FRAMES, EVERY = 40, 5
"""Frames of a recording, every fifth of which shows the one before."""
PERIOD_NS = 20_000_000
SCENES: Mapping[str, Mapping[str, Any]] = {
    "moving liner": {"scene": "liner"},
    "accuracy object at rest": {"scene": "accuracy_object"},
    "calibration frame": {"scene": "calibration_frame"},
}
NOISES: Mapping[str, Mapping[str, float]] = {
    "usual": {},
    "low": {"noise": 0.004, "jitter_px": 0.02},
}
CODECS: Mapping[str, Sequence[str]] = {
    "uncompressed": ("-c:v", "rawvideo"),
    "x264, crf 18": ("-c:v", "libx264", "-preset", "veryfast", "-crf", "18"),
    "x264, crf 23": ("-c:v", "libx264", "-preset", "veryfast", "-crf", "23"),
    "MJPEG, q 2": ("-c:v", "mjpeg", "-q:v", "2"),
    "MJPEG, q 5": ("-c:v", "mjpeg", "-q:v", "5"),
}


class Judged(NamedTuple):
    """Numbers of fields by what they are and what became of them."""

    genuine: int
    called: int
    marked: int
    repeats: int
    found: int

    def __str__(self) -> str:
        left_out = f", {self.marked} left out" if self.called else ""
        return f"{self.called} of {self.genuine}{left_out}; {self.found} of {self.repeats} found"


def rows() -> list[str]:
    """The section's table, in Markdown."""
    return list(_rows())


def _rows() -> Iterator[str]:
    yield f"| scene | noise | bits | {' | '.join(CODECS)} |\n"
    yield "|---|---|---|" + len(CODECS) * "---|" + "\n"
    with TemporaryDirectory() as name:
        for scene, options in SCENES.items():
            for noise, picture in NOISES.items():
                fields = _taken(options, picture)
                for bits in (8, 1):
                    shown = _with_repeats(_quantised(fields, bits))
                    found = [judged(shown, one, Path(name) / "clip.mkv") for one in CODECS.values()]
                    yield f"| {scene} | {noise} | {bits} | {' | '.join(map(str, found))} |\n"


def _taken(options: Mapping[str, Any], picture: Mapping[str, float]) -> list[Field]:
    """The fields of `FRAMES` frames, from a top one on, without a number in their corner."""
    grabber = FakeGrabber(pace="free", clock=JumpingClock(), picture={"stamp": False, **picture}, **options)
    grabber.open()
    fields: list[Field] = []
    while len(fields) < 2 * FRAMES:
        with grabber.dequeue(1.0) as grabbed:
            for one in grabbed:
                if fields or one.field.parity == 0:
                    fields.append(Field.intact(one.field.luma.copy(), one.field.parity))
    grabber.close()
    return fields


def _quantised(fields: Sequence[Field], bits: int) -> list[Field]:
    if bits == 8:
        return list(fields)
    counts = np.bincount(fields[0].luma.ravel(), minlength=256)
    threshold = choose_threshold(counts, ThresholdRule(), bits)
    return [unpack(quantise(one, bits, threshold)) for one in fields]


def _with_repeats(fields: Sequence[Field]) -> list[NDArray[np.uint8]]:
    woven = [np.empty((2 * fields[0].rows, fields[0].columns), np.uint8) for _ in range(FRAMES)]
    for k, frame in enumerate(woven):
        shown = k - _is_repeat(k)
        frame[0::2], frame[1::2] = fields[2 * shown].luma, fields[2 * shown + 1].luma
    return woven


def _is_repeat(k: int) -> bool:
    return k % EVERY == EVERY - 1


def judged(frames: Sequence[NDArray[np.uint8]], encoder: Sequence[str], path: Path) -> Judged:
    """Writes frames with an encoder of FFmpeg's, reads them as the program does, and judges each field."""
    ffmpeg_grey(path, frames, *encoder)
    judge, marks = RepeatJudge(of_any_parity=False), RepeatMarks(2)
    called: Counter[bool] = Counter()
    left_out: Counter[bool] = Counter()
    given: list[GrabbedField] = []
    for k, (_, luma) in enumerate(decoding(path).pictures()):
        halves = split_frame(np.asarray(luma, np.uint8))
        called[_is_repeat(k)] += sum(judge.take(one) for one in halves)
        batch = [GrabbedField(one, (2 * k + n) * PERIOD_NS, 2 * k + n, None) for n, one in enumerate(halves)]
        given += [one for passed in marks.take(batch) for one in passed]
    given += [one for passed in marks.end() for one in passed]
    for one in given:
        left_out[_is_repeat((one.sequence or 0) // 2)] += one.damage == REPEATED
    repeats = 2 * sum(map(_is_repeat, range(FRAMES)))
    return Judged(2 * FRAMES - repeats, called[False], left_out[False], repeats, called[True])
