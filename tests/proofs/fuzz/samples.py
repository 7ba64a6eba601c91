"""Valid files to begin with, made by the program itself."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np

from archive.captures import slots
from archive.readings import write_with_channels
from drivers.replay.pictures import frames
from drivers.replay.videos import avi, coded, y4m
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.state.backup import back_up
from grabberd.archive.state.state_database import StateStore
from grabberd.config import default_config_file
from proofs.fuzz.commands import run_command

CONFIGS = default_config_file().parent
FIELDS = 14
FIRST_FORMAT = Path(__file__).parents[2] / "archive" / "format_1"
"""Captures of format 1, which are read for ever."""


def make_samples(folder: Path) -> Path:
    """A folder for each kind of file, with one sample or a few."""
    make_small(folder)
    _captures(folder)
    return folder


def make_small(folder: Path) -> Path:
    """All but the captures, which take the program some seconds."""
    for kind in (
        "capture",
        "frame",
        "calibration",
        "object",
        "config",
        "truth",
        "vacuum",
        "png",
        "video",
        "manifest",
        "backup",
    ):
        (folder / kind).mkdir(parents=True, exist_ok=True)
    _texts(folder)
    _pictures(folder)
    _backup(folder)
    return folder


def _texts(folder: Path) -> None:
    shutil.copy(CONFIGS / "fake.calibration.json", folder / "calibration")
    for file in (*CONFIGS.glob("objects/*.yaml"), *CONFIGS.glob("calibration-frames/*.yaml")):
        shutil.copy(file, folder / "object")
    for file in (*CONFIGS.glob("*.yaml"), *CONFIGS.glob("analysis/*.yaml")):
        shutil.copy(file, folder / "config")
    rows = (f"{target},{target * 1.5},-2.25,{target / 7:.4f}" for target in range(1, 109))
    (folder / "truth" / "truth.csv").write_text("\n".join(["target,x_mm,y_mm,z_mm", *rows]))
    (folder / "truth" / "marks.csv").write_text("view,target,x_px,y_px\nleft,1,100.5,20\nright,2,400,30\n")
    readings = (f"{k * 0.01:.3f},{42 * (k % 100 < 60)},{42}" for k in range(300))
    head = "time_s,pulsation_vacuum_kpa,liner_vacuum_kpa"
    (folder / "vacuum" / "log.csv").write_text("\n".join([head, *readings]))


def _captures(folder: Path) -> None:
    """The liner at 1 and at 8 bits, also of format 1, and the calibration frame; the truth is the first's."""
    for name in ("one-bit.grab", "eight-bits.grab"):
        shutil.copy(FIRST_FORMAT / name, folder / "capture")
    write_with_channels(folder / "capture", slots(FIELDS), name="channels", measured=range(FIELDS))
    for name, config, bits in (
        ("capture/liner.grab", "fake.yaml", "1"),
        ("capture/grey.grab", "fake.yaml", "8"),
        ("frame/frame.grab", "fake-calibration-frame.yaml", "8"),
    ):
        words = ("--config", str(CONFIGS / config), "--fields", str(FIELDS), "--bits", bits)
        if code := run_command("capture", *words, "--out", str(folder / name)):
            raise SystemExit(f"no sample: grabberd capture ended with {code}")
    with CaptureReader(folder / "capture" / "liner.grab") as reader:
        rows = (
            f"{n},{target},{x},{y},{z}"
            for n, points in reader.points()
            for target, (x, y, z) in zip(points.target.tolist(), points.xyz_mm.round(4).tolist(), strict=True)
        )
        (folder / "truth" / "truth.csv").write_text("\n".join(["n,target,x_mm,y_mm,z_mm", *rows]))


def _pictures(folder: Path) -> None:
    frames(folder / "png", 1, lines=24, columns=40)
    colours = np.random.default_rng(1).integers(0, 256, (24, 40, 3), np.uint8)
    cv2.imwrite(str(folder / "png" / "colours.png"), colours)
    avi(folder / "video" / "a.avi", lines=48, columns=64)
    y4m(folder / "video" / "a.y4m", lines=48, columns=64)
    pictures = [np.random.default_rng(n).integers(0, 256, (48, 64), np.uint8) for n in range(3)]
    coded(folder / "video" / "b.avi", "FFV1", pictures)
    rows = (f"{n},{n * 20_000_000},{n},{n % 2},0,2,received,frame-0000.png" for n in range(4))
    text = "\n".join(["n,time_ns,sequence,parity,y0,y_step,outcome,file", *rows])
    (folder / "manifest" / "fields.csv").write_text(text)


def _backup(folder: Path) -> None:
    state = folder / "state"
    (state / "calibrations" / "rig-7").mkdir(parents=True, exist_ok=True)
    store = StateStore(state / "state.sqlite")
    store.open()
    store.put({"threshold": 60})
    document = json.loads((CONFIGS / "fake.calibration.json").read_text())
    (state / "calibrations" / "rig-7" / "calibration.json").write_text(json.dumps(document))
    back_up(state, folder / "backup" / "a.zip", "2026-03-01T09:30:00.000Z", "0.1.0")
