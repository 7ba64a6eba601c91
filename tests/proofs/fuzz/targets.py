"""What reads files from outside: each target takes one file, and may refuse it in words."""

import contextlib
import shutil
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from random import Random
from typing import NamedTuple

import yaml
from pydantic import ValidationError

from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.input_files import read_identifications, read_truth
from grabberd.archive.state.backup import restore
from grabberd.archive.state.index_entries import entry_of
from grabberd.bounded_documents import LARGEST_TABLE, read_text
from grabberd.config import default_config_file, load_config
from grabberd.core.geometry import Calibration
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import GrabberdError
from grabberd.files.reading import read_documents, read_yaml
from grabberd_liner.analysis.vacuum.vacuum_log import read_vacuum_log
from grabberd_replay import ReplayGrabber
from grabberd_v4l2.profiles import Profiles
from proofs.fuzz.commands import run_command
from proofs.fuzz.mutation import change_cells, changed

REFUSALS = (GrabberdError, ValidationError)
"""How a file is refused; anything else is a finding."""
CONFIGS = default_config_file().parent
CALIBRATION, LINER = CONFIGS / "fake.calibration.json", CONFIGS / "objects" / "liner.yaml"
_PICTURES_PLAYED = 10
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class Target(NamedTuple):
    """A reader of one kind of file.

    Attributes:
        kind: Folder of its samples.
        read: Reads a file; a further folder is its own, for what it writes.
    """

    kind: str
    read: Callable[[Path, Path], object]


def _calibration(path: Path, _: Path) -> None:
    document = read_documents(path, None)["calibration"]
    Calibration.from_document(Calibration.from_document(document).to_document())


def _object(path: Path, _: Path) -> None:
    ObjectModel.from_document(read_yaml(path))


def _profile(path: Path, folder: Path) -> None:
    (folder / "profiles").mkdir()
    shutil.copy(path, folder / "profiles" / "own.yaml")
    Profiles.load(folder / "profiles")


def _vacuum(path: Path, _: Path) -> None:
    try:
        text = read_text(path, LARGEST_TABLE)
    except ValueError:
        return  # as the command, which says so
    read_vacuum_log(text)


def _played(path: Path) -> None:
    grabber = ReplayGrabber(path)
    try:
        grabber.open()
        for _ in range(_PICTURES_PLAYED):
            with grabber.dequeue(0.1):
                pass
    finally:
        grabber.close()


def _png(path: Path, folder: Path) -> None:
    shutil.copy(path, folder / "a-1.png")
    _played(folder)


def _video(path: Path, folder: Path) -> None:
    named = folder / ("a.y4m" if path.read_bytes()[:9] == b"YUV4MPEG2" else "a.avi")
    shutil.copy(path, named)
    _played(named)


def _manifest(path: Path, folder: Path) -> None:
    shutil.copy(path, folder / "fields.csv")
    for picture in (path.parents[1] / "png").glob("frame-*.png"):
        shutil.copy(picture, folder)
    _played(folder)


def _backup(path: Path, folder: Path) -> None:
    restore(folder / "state", path, "20260301T093000Z")


def _reader(path: Path, _: Path) -> None:
    with CaptureReader(path) as reader:
        assert reader.ledger.total >= 0
        for run in reader.runs:
            list(reader.timed_points(run.run))
        list(reader.fields())
        _ = reader.channels.account
        for channel in reader.channels.all:
            reader.channels.read(channel.name)


def _index(path: Path, _: Path) -> None:
    entry_of(path)


def _seal(path: Path, folder: Path) -> None:
    shutil.copy(path, folder / "a.grab.part")
    recover(folder / "a.grab.part")


def _replay(path: Path, _: Path) -> None:
    _played(path)


def _command(*words: str) -> Callable[[Path, Path], None]:
    """A command; CAPTURE, OUT and the like stand for what they are."""

    def read(path: Path, folder: Path) -> None:
        given = {
            "CAPTURE": str(path),
            "OUT": str(folder / "out"),
            "CALIBRATION": str(CALIBRATION),
            "OBJECT": str(LINER),
            "INPUTS": str(CONFIGS / "analysis" / "liner.yaml"),
            "TRUTH": str(path.parents[1] / "truth" / "truth.csv"),
            "CONFIG": str(CONFIGS / "fake-calibration-frame.yaml"),
            "FRAME": str(CONFIGS / "calibration-frames" / "paper-108.yaml"),
        }
        run_command(*(given.get(word, word) for word in words))

    return read


FILES: Mapping[str, Target] = {
    "calibration": Target("calibration", _calibration),
    "object": Target("object", _object),
    "config": Target("config", lambda path, _: load_config(path)),
    "profile": Target("config", _profile),
    "truth": Target("truth", lambda path, _: read_truth(path)),
    "marks": Target("truth", lambda path, _: read_identifications(path)),
    "vacuum": Target("vacuum", _vacuum),
    "png": Target("png", _png),
    "video": Target("video", _video),
    "manifest": Target("manifest", _manifest),
    "backup": Target("backup", _backup),
    "capture": Target("capture", _reader),
    "index": Target("capture", _index),
    "replay": Target("capture", _replay),
    "seal": Target("capture", _seal),
}
COMMANDS: Mapping[str, Target] = {
    "export-csv": Target("capture", _command("export", "CAPTURE", "--format", "csv", "--out", "OUT")),
    "export-png": Target("capture", _command("export", "CAPTURE", "--format", "png", "--out", "OUT")),
    "export-ply": Target("capture", _command("export", "CAPTURE", "--format", "ply", "--out", "OUT")),
    "export-parquet": Target("capture", _command("export", "CAPTURE", "--format", "parquet", "--out", "OUT")),
    "export-mat": Target("capture", _command("export", "CAPTURE", "--format", "mat", "--out", "OUT")),
    "export-c3d": Target("capture", _command("export", "CAPTURE", "--format", "c3d", "--out", "OUT")),
    "measure": Target(
        "capture", _command("measure", "CAPTURE", "--calibration", "CALIBRATION", "--object", "OBJECT")
    ),
    "accuracy": Target("capture", _command("accuracy", "CAPTURE", "--truth", "TRUTH")),
    "accuracy-again": Target(
        "capture",
        _command(
            "accuracy", "CAPTURE", "--truth", "TRUTH", "--calibration", "CALIBRATION", "--object", "OBJECT"
        ),
    ),
    "analyse": Target(
        "capture", _command("analyse", "CAPTURE", "--inputs", "INPUTS", "--out", "OUT", "--formats", "csv")
    ),
    "calibrate": Target(
        "frame",
        _command(
            "calibrate", "CAPTURE", "--calibration-frame", "FRAME", "--config", "CONFIG", "--out", "OUT"
        ),
    ),
    "render-model": Target("capture", _command("render", "CAPTURE", "--what", "model", "--out", "OUT")),
    "render-overlay": Target("capture", _command("render", "CAPTURE", "--what", "overlay", "--out", "OUT")),
    "render-synthetic": Target(
        "capture", _command("render", "CAPTURE", "--what", "synthetic", "--out", "OUT")
    ),
    "reprocess": Target(
        "capture",
        _command(
            "reprocess",
            "CAPTURE",
            "--calibration",
            "CALIBRATION",
            "--object",
            "OBJECT",
            "--out",
            "OUT",
            "--workers",
            "1",
        ),
    ),
}
TARGETS = {**FILES, **COMMANDS}


def prepare(random: Random, samples: Path, kind: str, target: Path) -> None:
    """Makes a hostile file of a kind from its samples."""
    files = sorted(path for path in (samples / kind).iterdir() if path.is_file())
    sample = random.choice(files)
    if kind in ("capture", "frame") and random.random() < 0.8:
        shutil.copy(sample, target)
        change_cells(random, target)
    else:
        target.write_bytes(changed(random, sample.read_bytes(), [file.read_bytes() for file in files]))


def attempt(target: Target, file: Path) -> None:
    """Reads a file; refusals are what it is there for.

    Raises:
        Exception: Whatever else comes out of it: a finding.
    """
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder, contextlib.suppress(REFUSALS):
        target.read(file, Path(folder))
