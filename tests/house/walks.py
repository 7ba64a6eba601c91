"""Files that a calibration and an analysis pass, traced in the commands themselves."""

import tempfile
from pathlib import Path

from typer.testing import CliRunner

from grabberd.cli.app import app

from .hops import Trace, own
from .source import ROOT

CONFIGS = ROOT / "configs"
FIELDS = "100"


def walks() -> dict[str, list[str]]:
    """Own files that `grabberd calibrate` and `grabberd analyse` pass, relative to the package."""
    with tempfile.TemporaryDirectory() as folder:
        frame, liner, rig = (Path(folder, name) for name in ("frame.grab", "liner.grab", "rig.json"))
        _run("capture", "--config", CONFIGS / "fake-calibration-frame.yaml", "--fields", "32", "--out", frame)
        _run("capture", "--config", CONFIGS / "fake.yaml", "--fields", FIELDS, "--bits", "8", "--out", liner)
        target = CONFIGS / "calibration-frames" / "paper-108.yaml"
        inputs = CONFIGS / "analysis" / "liner.yaml"
        report = Path(folder, "report.html")
        return {
            "a calibration": _traced(
                "calibrate", frame, "--calibration-frame", target, "--out", rig, "--report", report
            ),
            "an analysis": _traced("analyse", liner, "--inputs", inputs, "--out", Path(folder, "analysis")),
        }


def _traced(*arguments: object) -> list[str]:
    trace = Trace()
    with trace.watching(), trace.story() as found:
        _run(*arguments)
    return own({file for some in found.values() for file in some})


def _run(*arguments: object) -> None:
    result = CliRunner().invoke(app, [str(one) for one in arguments])
    if result.exit_code:
        raise RuntimeError(f"grabberd {arguments[0]} failed: {result.output}\n{result.exception}")


if __name__ == "__main__":
    for story, files in walks().items():
        print(f"{story}: {len(files)}", *files, sep="\n    ")
