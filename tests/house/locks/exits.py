"""Command lines: how each ends, and what it says."""

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import Any
from unittest.mock import patch

import grabberd

from .computer import computer
from .doors import console, main
from .interface import PLAIN, WIDTH
from .kept import digest

FORMAT_1 = Path(__file__).parents[2] / "archive" / "format_1"
NOBODY = "http://127.0.0.1:9"
"""Address at which no daemon listens."""
LONGEST = 40
"""Lines of an output that is kept as it is."""
SECRET = re.compile(r"grabberd_[A-Za-z0-9_-]{20,}")
CONFIGS = ("fake.yaml", "four.yaml", "liner-test.yaml", "v4l2.yaml", "v4l2-camera.yaml")
LINES = (
    "--version",
    "frobnicate",
    "--frobnicate",
    "schema",
    "schema nothing",
    "schema object extra",
    "check-config absent.yaml",
    "check-config wrong.yaml",
    "check-config broken.yaml",
    "check-config {configs}/fake.yaml",
    "check-config {configs}/four.yaml",
    "check-config {configs}/liner-test.yaml",
    "check-config liner.grab",
    "plan --config {configs}/fake.yaml",
    "plan --config {configs}/fake.yaml --bits 8 --json",
    "plan --config absent.yaml",
    "frame --rows 3 --columns 4 --pitch-mm 6.5 --depth-mm 16 --out frame.yaml",
    "frame --rows 3 --columns 4 --pitch-mm 6.5 --depth-mm 16 --out frame.yaml",
    "frame --rows 0 --columns 4 --pitch-mm 6.5 --depth-mm 16 --out other.yaml",
    "new driver mycard --out mycard",
    "new logger mylogger --out mylogger",
    "new locator mine --out mine",
    "new nothing mine --out other",
    "new driver mycard --out mycard",
    "export absent.grab --out nothing",
    "export damaged.grab --out nothing",
    "export text.grab --out nothing",
    "export later.grab --out nothing",
    "export liner.grab --run 9 --out nothing",
    "export liner.grab --field 3 --out nothing",
    "export liner.grab --format xls --out nothing",
    "export liner.grab",
    "measure frame.grab --calibration absent.json --object absent.yaml",
    "measure frame.grab --calibration {configs}/fake.calibration.json --object wrong.yaml",
    "accuracy object.grab --truth {truth} --json",
    "accuracy object.grab --truth wrong.yaml",
    "accuracy frame.grab --truth {truth}",
    "analyse frame.grab --out analysed",
    "analyse liner.grab --inputs wrong.yaml --out analysed",
    "analyse liner.grab --label liner=A --out analysed",
    "calibrate liner.grab --calibration-frame absent.yaml --out made.json",
    "calibrate six-bits.grab --calibration-frame {frame} --out made.json",
    "inspect absent",
    "study nowhere --by liner --out studied",
    "test",
    "test list",
    "test nothing --capture liner.grab --out tested",
    "test reference simulated.grab --config state.yaml --out tested",
    "test reference one-bit.grab --config state.yaml --out tested-too",
    "test milking --evaluate one-bit.grab --out tested",
    "render liner.grab --what model --field 999 --out drawn",
    "render frame.grab --what model --out drawn",
    "reprocess absent --out again",
    "capture --fields 0 --out none.grab",
    "capture --fields 4 --out liner.grab --url {nobody}",
    "capture --fields 4 --out liner.grab",
    "status --url {nobody}",
    "jobs list --url {nobody}",
    "jobs show job-1 --url {nobody}",
    "trigger --url {nobody}",
    "points --url {nobody}",
    "check --url {nobody}",
    "status --url nonsense",
    "status --token-file absent",
    "token list --config state.yaml --json",
    "token add cup --role admin --config state.yaml",
    "token add cup --role admin --config state.yaml",
    "token add cup --role king --config state.yaml",
    "token remove nobody --config state.yaml",
    "storage verify liner.grab",
    "storage verify damaged.grab",
    "storage verify absent.grab",
    "storage convert text.grab",
    "storage seal liner.grab",
    "storage retention --config state.yaml",
    "profile list --config state.yaml",
    "profile show liner nobody --config state.yaml",
    "backup --config state.yaml --out backup.zip",
    "backup --config state.yaml --out backup.zip",
    "restore absent.zip --config state.yaml",
    "restore text.grab --config state.yaml",
    "logger nobody --config {configs}/fake.yaml",
    "devices --check nobody --config {configs}/fake.yaml",
)
"""In this order, in one folder: later ones find what earlier ones have made."""
COMPUTED = ("accuracy object", "plan", "test reference simulated")
"""Beginnings of lines whose output is computed: another kind of computer may differ in its last digits."""
MADE = ("mycard", "mylogger", "mine", "frame.yaml")
"""Files and folders that the lines have made, which never change."""


def exits() -> dict[str, Any]:
    """Exit code, output and errors of each line of `LINES`."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        places = _prepared(folder)
        ended = {f"{k:02} {line}": _ends(line, places, folder) for k, line in enumerate(LINES)}
        made = [file for one in MADE for file in [folder / one, *sorted((folder / one).rglob("*"))]]
        files = {str(file.relative_to(folder)): _content(file) for file in made if file.is_file()}
    return {"computer": computer(), "lines": ended, "made": files}


def _content(file: Path) -> str:
    return digest(file.read_text(encoding="utf-8").replace(str(grabberd_root()), "ROOT"))


def _ends(line: str, places: Mapping[str, str], folder: Path) -> dict[str, Any]:
    said = run(_words(line, places), folder)
    if line.startswith(COMPUTED):
        return {"exit": said["exit"], "exact": digest("\n".join(said.get("out", [])))}
    return said


def run(words: list[str], folder: Path) -> dict[str, Any]:
    """Runs `grabberd` in a folder; its name and secrets are masked in what it says."""
    out, err = (TextIOWrapper(BytesIO(), "utf-8", write_through=True) for _ in range(2))
    argv = patch.object(sys, "argv", ["grabberd", *words])
    # Words on usage begin with the program's name, which would be that of the test runner.
    package = patch.object(sys.modules["__main__"], "__package__", None)
    with _beside(folder), argv, package, redirect_stdout(out), redirect_stderr(err):
        code = _ended()
    said = {"exit": code, "out": _told(out, folder), "err": _told(err, folder)}
    return {key: value for key, value in said.items() if value != []}


def _ended() -> Any:
    try:
        main()
    except SystemExit as ended:
        return ended.code or 0
    return 0


@contextmanager
def _beside(folder: Path) -> Iterator[None]:
    """In the folder, with a terminal of a known width and nothing of the user's own."""
    before = Path.cwd()
    own = {key: value for key, value in os.environ.items() if not key.startswith(("GRABBERD_", "STATE_DIR"))}
    os.chdir(folder)
    try:
        # The console has read its width from the environment when it was made, which may have been before.
        with (
            patch.dict(os.environ, {**own, **PLAIN, "HOME": str(folder)}, clear=True),
            patch.object(console, "_width", WIDTH),
        ):
            yield
    finally:
        os.chdir(before)


def _told(stream: TextIOWrapper, folder: Path) -> list[str]:
    text = stream.buffer.getvalue().decode()  # type: ignore[attr-defined]
    masked = SECRET.sub("SECRET", text.replace(str(folder), "FOLDER").replace(str(grabberd_root()), "ROOT"))
    lines = [line.rstrip() for line in masked.splitlines()]
    return lines if len(lines) <= LONGEST else [*lines[:5], f"… {len(lines)} lines, {digest(masked)}"]


def grabberd_root() -> Path:
    """Folder of the source tree."""
    return Path(__file__).parents[3]


def _words(line: str, places: Mapping[str, str]) -> list[str]:
    return [word.format(**places) for word in line.split()]


def _prepared(folder: Path) -> dict[str, str]:
    """Makes the files that the lines name; returns places elsewhere."""
    for name in ("liner.grab", "frame.grab", "object.grab"):
        shutil.copy(grabberd.example(name), folder / name)
    for name in ("one-bit.grab", "six-bits.grab", "simulated.grab"):
        shutil.copy(FORMAT_1 / name, folder / name)
    whole = (folder / "object.grab").read_bytes()
    (folder / "damaged.grab").write_bytes(whole[:40_000] + bytes(4096) + whole[44_096:])
    (folder / "later.grab").write_bytes(whole[:60] + (99).to_bytes(4, "big") + whole[64:])
    (folder / "text.grab").write_text("no capture\n" * 200)
    (folder / "wrong.yaml").write_text(
        "devices: {one: {driver: nothing, colour: red}}\nhttp: {port: 99999}\n"
    )
    (folder / "broken.yaml").write_text("devices: [\n")
    configs = grabberd_root() / "configs"
    fake = (configs / "fake.yaml").read_text().replace("calibration: fake", f"calibration: {configs}/fake")
    fake = fake.replace("object: objects", f"object: {configs}/objects")
    (folder / "state.yaml").write_text(f"{fake}\nstorage: {{directory: {folder}/state}}\n")
    return {
        "configs": str(configs),
        "truth": str(grabberd.example("object-truth.csv")),
        "frame": str(grabberd.example("calibration-frame.yaml")),
        "nobody": NOBODY,
    }
