"""From an empty folder to a study of three liners, one command a step and at real pace, beside the truth."""

import csv
import io
import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path

import yaml
from tests.proofs.bench.liner_study import COWS
from tests.proofs.bench.liner_study_tables import Found, of_captures, of_liners, of_quantities
from tests.proofs.bench.pressure_case import paragraph

from grabberd.config import default_config_file

LINERS = ("reference", "wide", "thin")
"""Of which the program has example profiles."""
_STAGE = "liner-test/stage.yaml"
_MILKING_S = 8
_FLOW_STOP_KPA = 9


def table() -> str:
    """Markdown of all tables; a quarter of an hour."""
    with tempfile.TemporaryDirectory() as folder:
        verdict = run(Path(folder))
        return "\n".join(tables(Path(folder), verdict))


def run(folder: Path) -> str:
    """Makes all tests and the study; returns its table `comparison`."""
    (folder / "inputs.yaml").write_text(
        yaml.safe_dump({"flow_stop": {"kpa": _FLOW_STOP_KPA, "sigma_kpa": 1}})
    )
    for liner in LINERS:
        _configure(folder, liner)
    _grabberd(folder, "profile", "import", "--examples", f"--config={LINERS[0]}.yaml")
    for liner in LINERS:
        _set_stage(folder, f"--wall={liner}-empty", "--no-vacuum")
        _test(folder, "reference", liner, "reference")
        _set_stage(folder, f"--wall={liner}-empty", "--ramp")
        _test(folder, "ramp", liner, "ramp", "--accept")
        for cow, teat in COWS.items():
            _set_stage(folder, f"--wall={liner}-{teat}", "--milking")
            labels = (f"--label=cow={cow}", f"--label=teat={teat}")
            given = (*labels, f"--duration-s={_MILKING_S}", "--inputs=inputs.yaml")
            _test(folder, "milking", liner, cow, *given)
    made = [f"{liner}-{cow}" for liner in LINERS for cow in COWS]
    _grabberd(folder, "study", *made, "--by=liner", "--within=cow", "--out=study")
    return (folder / "study" / "comparison.csv").read_text()


def tables(folder: Path, comparison: str) -> list[str]:
    """Lines of all tables of a folder in which everything was made."""
    found = [one for liner in LINERS for cow in ("ramp", *COWS) for one in _found(folder, liner, cow)]
    milking = [one for one in found if one.cow]
    return [
        _introduction(),
        "",
        *of_liners(found),
        "",
        *of_captures(milking),
        "",
        *of_quantities(milking),
        "",
        *_differences(comparison),
    ]


def _introduction() -> str:
    return paragraph(
        "One command per step, at real pace, with the simulated grabber as a test bench for liners: the",
        "stage is set, then `grabberd test reference`, `ramp --accept`, and `milking` of",
        f"{_MILKING_S} s on the teats of four cows, for each of the three liners with example profiles;",
        "finally `grabberd study --by liner --within cow`. Both views see 4 columns. The vacuum comes from a",
        "logger with its own clock. The table is written only if every test",
        "passes. Cells are error / stated σ;",
        "times in ms. The cycle lasts a second, so that all fields fall on the same fifty phases.",
    )


def _differences(comparison: str) -> list[str]:
    """What the study says of the quantities that differ."""
    lines = ["| quantity that differs | liners | difference ± σ | p |", "|---|---|---|---|"]
    for row in csv.DictReader(io.StringIO(comparison)):
        if row["verdict"] == "differ":
            numbers = [float(row[name]) for name in ("difference", "sigma_difference", "adjusted_p")]
            liners = f"{row['second']} − {row['first']}".replace("example-", "")
            said = f"{numbers[0]:.3g} ± {numbers[1]:.2g} {row['unit']} | {numbers[2]:.2g}"
            lines.append(f"| {row['quantity']} | {liners} | {said} |")
    return lines


def _configure(folder: Path, liner: str) -> None:
    """The shipped configuration with the object model of this liner."""
    shipped = default_config_file().parent / "liner-test.yaml"
    document = yaml.safe_load(shipped.read_text())
    options = json.dumps({"liner": {"wall": f"{liner}-empty"}})
    printed = _fake(folder, "object", "liner", f"--options={options}")
    (folder / f"{liner}.object.yaml").write_text(printed)
    document["devices"]["bench"] |= {
        "object": f"{liner}.object.yaml",
        "calibration": str(shipped.parent / "fake.calibration.json"),
    }
    (folder / f"{liner}.yaml").write_text(yaml.safe_dump(document))


def _set_stage(folder: Path, *words: str) -> None:
    _fake(folder, "stage", _STAGE, *words)


def _test(folder: Path, kind: str, liner: str, name: str, *words: str) -> None:
    given = (f"--config={liner}.yaml", f"--liner=example-{liner}", f"--out={liner}-{name}")
    _grabberd(folder, "test", kind, *given, *words)


def _found(folder: Path, liner: str, name: str) -> list[Found]:
    """What a test found, beside the truth of its recording."""
    made = folder / f"{liner}-{name}"
    (recording,) = made.glob("*.grab")
    true = {row["name"]: float(row["value"]) for row in _truth(folder, recording)}
    rows = json.loads((made / "test.json").read_text())["quantities"]
    cow = "" if name == "ramp" else name
    return [
        Found(liner, cow, row["name"], row["unit"], *_numbers(row), true[row["name"]])
        for row in rows
        if row["name"] in true
    ]


def _numbers(row: Mapping[str, float | None]) -> tuple[float, float, float]:
    value, sigma, common = (row[key] for key in ("value", "sigma", "sigma_common"))
    nothing = float("nan")
    return (nothing if value is None else value, nothing if sigma is None else sigma, common or 0.0)


def _truth(folder: Path, recording: Path) -> list[dict[str, str]]:
    printed = _fake(folder, "truth", str(recording), "--of=quantities", f"--flow-stop-kpa={_FLOW_STOP_KPA}")
    return list(csv.DictReader(io.StringIO(printed)))


def _fake(folder: Path, *words: str) -> str:
    return _run(folder, [sys.executable, "-m", "grabberd_fake", *words])


def _grabberd(folder: Path, *words: str) -> None:
    _run(folder, [str(Path(sys.executable).with_name("grabberd")), *words])


def _run(folder: Path, words: list[str]) -> str:
    done = subprocess.run(
        words, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False
    )
    if done.returncode:
        raise RuntimeError(f"{' '.join(words)}: {done.stderr}{done.stdout}")
    return done.stdout
