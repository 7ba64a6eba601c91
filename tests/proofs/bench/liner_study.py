"""From an empty folder to three liners on four cows each, by the program's own commands, beside the truth."""

import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml
from tests.proofs.bench.liner_study_tables import Found, tables

from grabberd.archive.capture.reader import CaptureReader
from grabberd.config import default_config_file
from grabberd_fake.__main__ import object_document
from grabberd_fake.liner_truth import quantities_of
from grabberd_fake.options import FakeOptions
from grabberd_fake.wall_states import wall_states

LINERS = ("reference", "wide", "stiffening")
COWS: Mapping[str, str] = {"112": "round", "208": "blunt", "331": "pointed", "419": "round"}
"""Cows by name, and the shape of the teat of each."""
SEED = 40
"""Of all that is told wrongly within its σ, and of the noise; nothing was tuned on it."""
_KNOWN = {"E_mpa": 0.2, "wall_mm": 0.03, "F0_n": 0.2}
"""Relative σ of what a data sheet, a calliper and a spring balance say of a liner."""
_GAUGE_KPA, _NOISE_KPA, _CLOCK_S, _FLOW_STOP_KPA = 0.1, 0.1, 0.0005, 1.0
_MILKING = {"period_s": 0.97}
FIELD_S = 0.02
_RAMP: Mapping[str, Any] = {
    "period_s": 10.0,
    "vacuum": {"system_kpa": 20.0, "liner_kpa": 20.0, "rising": 0.05, "open": 0.1, "falling": 0.8},
}
"""Eight seconds from 0 to 20 kPa: a real wall needs a minute, for losses and creep that this one has not."""
_MILKING_FIELDS, _RAMP_FIELDS = 150, 500


class Told(NamedTuple):
    """One liner as its user knows it before the ramp.

    Attributes:
        design: of the solved wall.
        material: as it is told, with σ.
        gauge_kpa: what the vacuum gauge shows too much, the same in all captures of the liner.
    """

    design: str
    material: dict[str, Any]
    gauge_kpa: float

    @classmethod
    def drawn(cls, design: str, random: np.random.Generator) -> "Told":
        """Values that are off by what their σ allow."""
        true = wall_states(f"{design}-empty").about["design"]
        values = {"E_mpa": true["young_mpa"], "wall_mm": true["wall_mm"], "F0_n": true["pretension_n"]}
        material = {"law": "neo_hookean", "poisson": 0.5, "radius_mm": true["radius_mm"], "target_mm": 0.0}
        for name, value in values.items():
            quantity, unit = name.rsplit("_", 1)
            material[name] = round(value * (1 + _KNOWN[name] * random.normal()), 4)
            material[f"{quantity}_sigma_{unit}"] = round(value * _KNOWN[name], 4)
        ends = {"first_end_mm": -65.0, "last_end_mm": 65.0}
        return cls(design, material | ends, float(_GAUGE_KPA * random.normal()))

    def profile(self) -> dict[str, Any]:
        """Its first version."""
        obtained = dict.fromkeys(("E_mpa", "wall_mm", "radius_mm", "F0_n"), "data sheet")
        analysis = {"reference": {"phase": 0.3}, "phases": 24, "sought_kpa": 1.0}
        return {
            "kind": "liner",
            "name": self.design,
            "material": self.material,
            "obtained": obtained,
            "analysis": analysis,
        }


class Bench:
    """A folder with the configuration, the profiles and the captures of one liner."""

    def __init__(self, folder: Path, design: str, seed: int) -> None:
        self._folder, self._seed = folder, seed
        self._told = told = Told.drawn(design, np.random.default_rng(seed))
        folder.mkdir()
        wall = {"liner": {"wall": f"{told.design}-empty"}}
        self._write("object.yaml", object_document(FakeOptions.read({"scene": "liner", **wall})))
        self._add(told.profile())

    def ramp(self) -> tuple[Found, ...]:
        """Captures and analyses a ramp, and takes what it found of the material into the profile."""
        random = np.random.default_rng([self._seed, 0])
        capture = self._capture("ramp", {"wall": f"{self._told.design}-empty", **_RAMP}, _RAMP_FIELDS, {})
        with CaptureReader(capture) as reader:
            first_s = next(reader.fields()).numbered.time_ns / 1e9
        folder = self._analyse(
            capture, {"teat": "none", "reference": {"field": _open_field(first_s)}}, random
        )
        (row,) = _rows(folder / "ramp.csv")
        profile = self._told.profile()
        profile["material"] = json.loads(row["material"])
        profile["obtained"] |= dict.fromkeys(("E_mpa", "wall_mm", "F0_n"), "ramp with the empty liner")
        self._add(profile)
        return self._found(folder, "", quantities_of(_liner({"wall": f"{self._told.design}-empty"})))

    def milking(self, cow: str) -> tuple[Found, ...]:
        """Captures and analyses a liner on the teat of a cow."""
        random = np.random.default_rng([self._seed, int(cow)])
        stage = {"wall": f"{self._told.design}-{COWS[cow]}", **_MILKING}
        capture = self._capture(cow, stage, _MILKING_FIELDS, {"cow": cow})
        told_kpa = 9.0
        true_kpa = told_kpa + _FLOW_STOP_KPA * random.normal()
        flow_stop = {"kpa": told_kpa, "sigma_kpa": _FLOW_STOP_KPA}
        folder = self._analyse(capture, {"flow_stop": flow_stop}, random)
        return self._found(folder, cow, quantities_of(_liner(stage), true_kpa))

    def _capture(self, name: str, stage: Mapping[str, Any], fields: int, labels: Mapping[str, str]) -> Path:
        options = {"scene": "liner", "pace": "free", "liner": dict(stage), "seed": self._seed}
        config = self._write(f"{name}.config.yaml", _configuration(self._folder, options))
        out = self._folder / f"{name}.grab"
        given = [f"--label={key}={value}" for key, value in {"liner": self._told.design, **labels}.items()]
        _grabberd(config, "capture", f"--fields={fields}", "--bits=8", f"--out={out}", *given)
        return out

    def _analyse(self, capture: Path, inputs: Mapping[str, Any], random: np.random.Generator) -> Path:
        offset_s = float(random.uniform(-2, 2))
        told_s = offset_s + _CLOCK_S * random.normal()
        vacuum = {"pulsation": "log", "liner": "log", "gauge_sigma_kpa": _GAUGE_KPA}
        vacuum |= {"offset": {"s": round(told_s, 6), "sigma_s": _CLOCK_S}}
        name, out = capture.stem, capture.with_suffix("")
        told = self._write(f"{name}.inputs.yaml", yaml.safe_dump({"vacuum": vacuum, **inputs}))
        log = self._write(f"{name}.vacuum.csv", self._vacuum_log(capture, offset_s))
        config = self._folder / f"{name}.config.yaml"
        given = (f"--inputs={told}", f"--vacuum-log={log}", f"--out={out}")
        _grabberd(config, "analyse", str(capture), "--profiles", *given)
        return out

    def _vacuum_log(self, capture: Path, offset_s: float) -> str:
        """What a logger recorded, whose gauge of the pulsation chamber is off."""
        words = ("truth", str(capture), "--of=vacuum", f"--offset-s={offset_s}", f"--noise-kpa={_NOISE_KPA}")
        printed = _run([sys.executable, "-m", "grabberd_fake", *words, "--rate-hz=200"])
        head, *lines = printed.splitlines()
        shifted = (line.split(",") for line in lines)
        rows = (f"{time},{float(kpa) + self._told.gauge_kpa:.4f},{liner}" for time, kpa, liner in shifted)
        return "\n".join([head, *rows]) + "\n"

    def _found(self, folder: Path, cow: str, true: Mapping[str, float]) -> tuple[Found, ...]:
        rows = (row for row in _rows(folder / "quantities.csv") if row["name"] in true)
        return tuple(Found.of(self._told.design, cow, row, true[row["name"]]) for row in rows)

    def _add(self, profile: Mapping[str, Any]) -> None:
        config = self._write("config.yaml", _configuration(self._folder, {"scene": "liner"}))
        _grabberd(config, "profile", "add", str(self._write("liner.yaml", yaml.safe_dump(dict(profile)))))

    def _write(self, name: str, text: str) -> Path:
        (self._folder / name).write_text(text)
        return self._folder / name


def table() -> str:
    """Markdown of all tables."""
    return "\n".join(tables(found(LINERS, SEED)))


def found(liners: Sequence[str], seed: int) -> tuple[Found, ...]:
    """Everything that the analyses found, beside the truth."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        benches = [Bench(Path(folder) / design, design, seed + index) for index, design in enumerate(liners)]
        ramps = list(pool.map(Bench.ramp, benches))
        pairs = [(bench, cow) for bench in benches for cow in COWS]
        milkings = list(pool.map(lambda pair: pair[0].milking(pair[1]), pairs))
        return tuple(one for part in (*ramps, *milkings) for one in part)


def _open_field(first_s: float) -> int:
    """Number of a field in the middle of the ramp's open part, of a capture of one period."""
    vacuum, period_s = _RAMP["vacuum"], _RAMP["period_s"]
    middle_s = (vacuum["rising"] + vacuum["open"] / 2) * period_s
    return int((middle_s - first_s) % period_s / FIELD_S)


def _liner(stage: Mapping[str, Any]) -> Any:
    return FakeOptions.read({"scene": "liner", "liner": dict(stage)}).liner


def _configuration(folder: Path, options: Mapping[str, Any]) -> str:
    """The shipped one, with these options of the simulated grabber, and everything else in the folder."""
    shipped = default_config_file()
    device = yaml.safe_load(shipped.read_text())["devices"]["simulated"]
    own = {"options": dict(options), "object": "object.yaml"}
    device |= own | {"calibration": str(shipped.parent / "fake.calibration.json")}
    return yaml.safe_dump({"devices": {"simulated": device}, "storage": {"directory": str(folder)}})


def _grabberd(config: Path, *words: str) -> None:
    _run([str(Path(sys.executable).with_name("grabberd")), *words, f"--config={config}"])


def _rows(file: Path) -> list[dict[str, str]]:
    with file.open() as lines:
        return list(csv.DictReader(lines))


def _run(command: Sequence[str]) -> str:
    environment = {**os.environ, "GRABBERD_URL": "", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment)  # noqa: PLW1510
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr[-2000:]}")
    return done.stdout
