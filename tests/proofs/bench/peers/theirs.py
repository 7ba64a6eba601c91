"""The peers' side, a process of their environment: `python -m tests.proofs.bench.peers.theirs FIELDS.npz`.

Asked by lines of JSON, it answers each with one: `{"way": …}` with what it took for every field, `{"way": …,
"found": true}` with what was found. What a peer returns is only read out while nobody takes its time.
"""

import importlib.metadata
import json
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, TextIO

import cv2
import numpy as np
import scipy.ndimage
import skimage.measure
import trackpy
from tests.proofs.bench.peers import optv_ways
from tests.proofs.bench.peers.buffers import in_buffers

Done = Callable[[Any], Mapping[str, Any]]
PACKAGES = ("numpy", "opencv-python-headless", "scipy", "scikit-image", "trackpy", "numba", "optv")
DISCS_TIMES = 20
EIGHT_NEIGHBOURS = np.ones((3, 3), int)
TRACKPY = {"diameter": (7, 11), "minmass": 800, "percentile": 95, "engine": "numba"}
"""Of those tried: all targets, nothing else, the smallest errors, and the fastest at that."""


class Way(NamedTuple):
    """One way of a peer: the work on picture k, and what `work` returned as a document."""

    work: Callable[[int], Any]
    found: Done
    pictures: Iterable[int]


def main() -> None:
    """Answers until nobody asks any more."""
    warnings.simplefilter("ignore")
    trackpy.quiet()
    cv2.setNumThreads(1)
    answers = _own_output()
    given = np.load(sys.argv[1])
    ways = all_ways({name: given[name] for name in given.files})
    for line in sys.stdin:
        print(json.dumps(_answer(ways, json.loads(line))), file=answers, flush=True)


def _own_output() -> TextIO:
    """Standard output for answers alone: what libraries print goes to standard error."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    return answers


def all_ways(given: Mapping[str, Any]) -> dict[str, Way]:
    """By the names that they are asked for."""
    count, settled = len(given["luma"]), int(given["settled"])
    pictures = range(settled, count)
    ways = {}
    for lines in ("288", "doubled"):
        for name, (work, found) in labelling(given[f"mask_{lines}"]).items():
            ways[f"{name}, {lines}"] = Way(work, found, pictures)
    for name, (work, found) in grey(given["luma"], int(given["level"])).items():
        ways[name] = Way(work, found, pictures)
    for name, (work, found) in optv_ways.ways(given).items():
        ways[name] = Way(work, found, pictures)
    for name, work in packing(given["luma"], given["parity"], int(given["level"])).items():
        ways[name] = Way(work, _nothing, pictures)
    for name in (name for name in given if name.startswith("discs")):
        ways[name] = Way(lambda _, mask=given[name]: _fastest(mask), _cv2_places, [0] * DISCS_TIMES)
    return ways


def labelling(masks: Any) -> dict[str, tuple[Callable[[int], Any], Done]]:
    """Pictures of 0 and 1 to components with their centres."""
    return {
        "cv2": (lambda k: cv2.connectedComponentsWithStats(masks[k]), _cv2_places),
        "cv2 fastest": (lambda k: _fastest(masks[k]), _cv2_places),
        "scipy": (lambda k: _scipy(masks[k]), _row_column),
        "skimage": (lambda k: _skimage(masks[k]), _row_column),
    }


def grey(luma: Any, level: int) -> dict[str, tuple[Callable[[int], Any], Done]]:
    """Pictures of 8 bits to centres weighted by brightness."""
    return {
        "skimage weighted": (lambda k: _skimage_weighted(luma[k], level), _row_column),
        "trackpy": (
            lambda k: trackpy.locate(luma[k], **TRACKPY),
            lambda found: {"places": found[["x", "y"]].to_numpy().tolist()},
        ),
    }


def packing(luma: Any, parities: Any, level: int) -> dict[str, Callable[[int], Any]]:
    """A field in a driver's buffer to packed bits; its content is not checked."""
    views = in_buffers(luma, parities)
    return {
        "packing, doubled": lambda k: _doubled_bits(views[k], int(parities[k]), level),
        "packing, 288": lambda k: np.packbits(np.ascontiguousarray(views[k]) > level, axis=1),
    }


def _doubled_bits(view: Any, parity: int, level: int) -> Any:
    """Of those tried, the fastest: copied first, the means by OpenCV, and so the threshold."""
    luma = np.ascontiguousarray(view)
    doubled = np.empty((2 * len(luma), luma.shape[1]), np.uint8)
    doubled[parity::2] = luma
    doubled[1 + parity : len(doubled) - 1 + parity : 2] = cv2.addWeighted(luma[:-1], 0.5, luma[1:], 0.5, 0.25)
    outermost = 0 if parity else -1
    doubled[outermost] = luma[outermost]
    return np.packbits(cv2.threshold(doubled, level, 1, cv2.THRESH_BINARY)[1], axis=1)


def _nothing(_: Any) -> Mapping[str, Any]:
    """Bits have no places."""
    return {"places": []}


def _fastest(mask: Any) -> Any:
    return cv2.connectedComponentsWithStatsWithAlgorithm(mask, 8, cv2.CV_16U, cv2.CCL_BOLELLI)


def _scipy(mask: Any) -> Any:
    labels, count = scipy.ndimage.label(mask, EIGHT_NEIGHBOURS)
    return scipy.ndimage.center_of_mass(mask, labels, np.arange(1, count + 1))


def _skimage(mask: Any) -> Any:
    return [one.centroid for one in skimage.measure.regionprops(skimage.measure.label(mask, connectivity=2))]


def _skimage_weighted(luma: Any, level: int) -> Any:
    above = np.maximum(luma, level) - level
    labels = skimage.measure.label(above > 0, connectivity=2)
    return [one.centroid_weighted for one in skimage.measure.regionprops(labels, intensity_image=above)]


def _cv2_places(found: Any) -> Mapping[str, Any]:
    return {"places": found[3][1:].tolist()}


def _row_column(found: Any) -> Mapping[str, Any]:
    return {"places": np.array(found).reshape(-1, 2)[:, ::-1].tolist()}


def _answer(ways: Mapping[str, Way], asked: Mapping[str, Any]) -> Mapping[str, Any]:
    if "way" not in asked:
        return {"ways": list(ways), "versions": _versions()}
    way = ways[asked["way"]]
    if asked.get("found"):
        return {"found": [way.found(way.work(k)) for k in way.pictures]}
    return {"us": [_taken_us(way.work, k) for k in way.pictures]}


def _taken_us(work: Callable[[int], Any], k: int) -> float:
    before = time.thread_time_ns()
    work(k)
    return (time.thread_time_ns() - before) / 1000


def _versions() -> dict[str, str]:
    return {name: importlib.metadata.version(name) for name in PACKAGES}


if __name__ == "__main__":
    main()
