"""Valid files to begin with, made by the program itself."""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np

from drivers.replay.pictures import frames
from drivers.replay.videos import avi, coded, y4m
from fuzz.commands import run_command
from grabberd.config import default_config_file
from grabberd.storage.state.backup import back_up
from grabberd.storage.state.state_store import StateStore

CONFIGS = default_config_file().parent
FIELDS = 14


def make_samples(folder: Path) -> Path:
    """A folder for each kind of file, with one sample or a few."""
    make_small(folder)
    _captures(folder)
    return folder


def make_small(folder: Path) -> Path:
    """All but the captures, which take the program some seconds."""
    for kind in (
        "capture",
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
    """One of 1 bit that has been measured, and one of 8 bits without points."""
    config = ("--config", str(CONFIGS / "fake.yaml"), "--fields", str(FIELDS))
    measured, grey = folder / "capture" / "liner.grab", folder / "capture" / "grey.grab"
    for out, options in ((measured, ()), (grey, ("--bits", "8"))):
        code = run_command("capture", *config, *options, "--out", str(out))
        if code:
            raise SystemExit(f"no sample: grabberd capture ended with {code}")


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
