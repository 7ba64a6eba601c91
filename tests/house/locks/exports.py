"""Files that exports write of the committed captures: a digest for each, and its size."""

import tempfile
from pathlib import Path
from typing import Any

import grabberd

from .computer import computer, packages
from .exits import FORMAT_1, run
from .kept import canonical, digest

FORMATS = ("csv", "ply", "parquet", "hdf5", "mat", "c3d", "png")
ANALYSIS_FORMATS = ("csv", "parquet", "hdf5", "vtu", "ply", "mat")
MASKED = ("report.html", "report.json", "analysis.h5", "analysis.mat")
"""Files of an analysis that hold the time at which it was made, as the metadata of Parquet files do."""
PARQUET = ".parquet"
DATED = {".mat": 116}
"""Bytes at a file's beginning that hold the time of writing: the words of a MAT-file about itself."""
PACKED = (".parquet", ".h5", ".png")
"""Endings of files whose bytes a package decides on."""
MANY = 20
"""Files of one ending in a folder, above which they are told together."""
NOMINAL = {
    "reference": "nominal",
    "material": {
        "law": "neo_hookean",
        "E_mpa": 3.0,
        "E_sigma_mpa": 0.1,
        "wall_mm": 2.5,
        "wall_sigma_mm": 0.05,
        "poisson": 0.5,
        "F0_n": 60.0,
        "F0_sigma_n": 3.0,
        "radius_mm": 12.5,
        "target_mm": 0.0,
    },
    "plane": "symmetry",
    "heights_mm": [-30, 0, 30],
}
"""Inputs that are had of few fields: no cycle, and no pressure."""


def points_files() -> dict[str, Any]:
    """Files of `grabberd export`, of a capture with channels and of one of format 1, in every format."""
    files = {"liner": grabberd.example("liner.grab"), "simulated": FORMAT_1 / "simulated.grab"}
    found: dict[str, Any] = {"packages": packages()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for capture, file in files.items():
            for form in FORMATS:
                out = folder / f"{capture}-{form}"
                done = run(["export", str(file), "--format", form, "--out", str(out)], folder)
                found[out.name] = {"said": done, "files": _digests(out)}
    return found


def analysis_files() -> dict[str, Any]:
    """Files of an analysis in every format; those that hold the present time are told by their names."""
    with tempfile.TemporaryDirectory() as name, grabberd.open(FORMAT_1 / "simulated.grab") as capture:
        out = Path(name) / "analysed"
        capture.analyse(NOMINAL).save(out, ANALYSIS_FORMATS)
        files = {file: one if _lasts(file) else "…" for file, one in _digests(out).items()}
    return {"computer": computer(), "exact": files, "names": sorted(files)}


def pictures() -> dict[str, Any]:
    """A picture of each side of the grid model."""
    drawn = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = grabberd.example("liner.grab")
        for what in ("model", "overlay", "synthetic"):
            words = ["render", str(file), "--what", what, "--field", "25", "--out", str(folder / what)]
            said = run(words, folder)
            drawn[what] = {"exit": said["exit"], "exact": _digests(folder / what)}
    return {"computer": computer(), **drawn}


def without_packed(document: Any) -> Any:
    """The document without what a package of another version writes in another way."""
    if not isinstance(document, dict):
        return document
    kept = {key: one for key, one in document.items() if key != "packages" and not key.endswith(PACKED)}
    return {key: without_packed(one) for key, one in kept.items()}


def _lasts(file: str) -> bool:
    return file not in MASKED and not file.endswith(PARQUET)


def _digests(folder: Path) -> dict[str, str]:
    """Digest and size of each file; of a folder with many of one ending, all of them together."""
    found: dict[str, list[Path]] = {}
    for file in sorted(folder.rglob("*")):
        if file.is_file():
            found.setdefault(_group(file, folder), []).append(file)
    return {name: _digest(files, folder) for name, files in found.items()}


def _group(file: Path, folder: Path) -> str:
    same = list(file.parent.glob(f"*{file.suffix}"))
    relative = file.relative_to(folder)
    return relative.as_posix() if len(same) <= MANY else (relative.parent / f"*{file.suffix}").as_posix()


def _digest(files: list[Path], folder: Path) -> str:
    if len(files) == 1:
        content = files[0].read_bytes()[DATED.get(files[0].suffix, 0) :]
        return f"{len(content)} bytes {digest(content)}"
    each = {file.relative_to(folder).as_posix(): digest(file.read_bytes()) for file in files}
    return f"{len(files)} files {digest(canonical(each))}"
