"""A digital camera's pictures: processor time for their luma, and what compression costs in accuracy."""

import time
from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import Field, Packing, pack
from grabberd.core.measurement import LocationSettings, measure
from grabberd_v4l2.formats import JpegLuma, bytes_per_pixel, luma

SIZES = ((640, 480), (1280, 720), (1920, 1080))
QUALITIES = (75, 90)
OF_ACCURACY = (None, 95, 90, 75, 50)
RATE_HZ = 60
PICTURES = 60
FINER = 16
"""Steps of a pixel that polygons are drawn in."""
DIAMETER_PX, PITCH_PX, SPREAD_PX, NOISE = 5.0, 22.0, 0.8, 4.0
SEEDS = range(40, 46)

Picture = NDArray[np.uint8]


def table_of_cost() -> str:
    """Medians of ms a picture, by turns with OpenCV's own decoding into colours."""
    rows = []
    for size in SIZES:
        picture, _ = drawn(1, *size)
        for fourcc in ("GREY", "YUYV", "UYVY"):
            ms = _median_ms(_raw(picture, fourcc))
            rows.append(_row(size, fourcc, picture.size * bytes_per_pixel(fourcc), ms, None))
        for quality in QUALITIES:
            data, decoder = compressed(picture, quality), JpegLuma(*picture.shape)
            ours, theirs = _by_turns(
                lambda data=data, decoder=decoder: decoder.decode(data),  # type: ignore[misc]
                lambda data=data: cv2.imdecode(data, cv2.IMREAD_COLOR),  # type: ignore[misc]
            )
            rows.append(_row(size, f"MJPG, quality {quality}", data.size, ours, theirs))
    seen = f"discs of {DIAMETER_PX:g} px, noise of {NOISE:g} grey levels"
    by = f"OpenCV {cv2.__version__}, one thread; {seen}.\n"
    head = f"| size | format | kB | ms a picture | of a core at {RATE_HZ} Hz | of OpenCV's, in colour |"
    return "\n".join([by, head, "|---|---|---|---|---|---|", *rows])


def table_of_accuracy() -> str:
    """RMS errors of discs in progressive pictures of 640×480, as they are and compressed."""
    head = "| JPEG | 8 bit, x / y px | χ² | 1 bit, x / y px | χ² |"
    rows = []
    for quality in OF_ACCURACY:
        words = ["none" if quality is None else f"quality {quality}"]
        for bits in (8, 1):
            error, share = _errors(quality, bits)
            x, y = np.sqrt((error**2).mean(axis=0))
            words += [f"{x:.4f} / {y:.4f}", f"{(share**2).mean():.2f}"]
        rows.append(f"| {' | '.join(words)} |")
    by = f"{len(SEEDS)} pictures of 560 discs each, drawn as polygons; colour in half of the columns.\n"
    return "\n".join([by, head, "|---|---|---|---|---|", *rows])


def drawn(seed: int, columns: int = 640, lines: int = 480) -> tuple[Picture, NDArray[np.float64]]:
    """A picture of discs in a grid that is shaken, and their centres (N, 2)."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(20, columns - 20, PITCH_PX), np.arange(20, lines - 20, PITCH_PX))
    places = np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(-3, 3, (x.size, 2))
    fine = np.zeros((lines * FINER, columns * FINER), np.uint8)
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    edge = DIAMETER_PX / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for place in places:
        corners = ((place + edge + 0.5) * FINER - 0.5) * 256
        cv2.fillPoly(fine, [np.round(corners).astype(np.int32)], [255], shift=8)
    light = cv2.resize(fine, (columns, lines), interpolation=cv2.INTER_AREA).astype(np.float32)
    grey = 20 + cv2.GaussianBlur(light, (0, 0), SPREAD_PX) / 255 * 160 + rng.normal(0, NOISE, light.shape)
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8), places


def compressed(picture: Picture, quality: int) -> Picture:
    """Bytes of a JPEG as cameras make it."""
    half = [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_422]
    coloured = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    _, data = cv2.imencode(".jpg", coloured, [cv2.IMWRITE_JPEG_QUALITY, quality, *half])
    return data.ravel().astype(np.uint8, copy=False)


def _errors(quality: int | None, bits: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    found = []
    for seed in SEEDS:
        picture, places = drawn(seed)
        seen = picture
        if quality is not None:
            decoded, damage = JpegLuma(*picture.shape).decode(compressed(picture, quality))
            assert damage is None
            assert decoded is not None
            seen = decoded
        blobs = measure(pack(Field.progressive(seen), Packing(bits, False, 60)), None, LocationSettings())
        nearest = np.linalg.norm(blobs.xy_px[:, np.newaxis] - places, axis=2).argmin(axis=1)
        error = blobs.xy_px - places[nearest]
        found.append((error, error / blobs.sigma_px))
    error, share = (np.concatenate(one) for one in zip(*found, strict=True))
    return error, share


def _raw(picture: Picture, fourcc: str) -> Callable[[], object]:
    lines, columns = picture.shape
    stride = columns * bytes_per_pixel(fourcc)
    buffer = np.full((lines, stride), 128, np.uint8)
    buffer[:, fourcc == "UYVY" :: bytes_per_pixel(fourcc)] = picture
    return lambda: luma(buffer.ravel(), fourcc, lines, columns, stride)


def _by_turns(*what: Callable[[], object]) -> tuple[float, ...]:
    taken: list[list[float]] = [[] for _ in what]
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    for _ in range(PICTURES):
        for one, times in zip(what, taken, strict=True):
            before = time.thread_time_ns()
            one()
            times.append((time.thread_time_ns() - before) / 1e6)
    cv2.setNumThreads(threads)
    return tuple(float(np.median(times)) for times in taken)


def _median_ms(what: Callable[[], object]) -> float:
    return _by_turns(what)[0]


def _row(size: tuple[int, int], name: str, count: int, ms: float, theirs_ms: float | None) -> str:
    ratio = "–" if theirs_ms is None else f"{ms / theirs_ms:.2f}"
    share = f"{ms * RATE_HZ / 1e3:.1%}"
    return f"| {size[0]}×{size[1]} | {name} | {count / 1000:.0f} | {ms:.3f} | {share} | {ratio} |"
