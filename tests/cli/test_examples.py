"""Every example of every command's help is run as it stands, on captures that come with the program."""

import json
import shutil
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from several import service_of, wait_until_they_accept
from typer.testing import CliRunner, Result

from archive.captures import meta, slots, write
from archive.milkings import milking
from cli.examples import Example, commands, examples
from core.chain.milking import still
from grabberd import example
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.cli.app import app
from grabberd.client.daemon import Daemon as Client
from grabberd.config import shipped_configs
from grabberd.documents.enums import Role
from grabberd.library.jobs.measurement import MeasurementJob
from liner.studies.results import COMPRESSION, report
from server.api.daemons import Daemon, served, serving

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

EXAMPLES = examples()
PARSED_ONLY = {
    "serve": "runs until it is ended; tests/server/api and tests/proofs/faults start daemons",
    "outlet lsl": "runs until it is ended; tests/drivers/lsl receives what it streams",
    "check": "watches the calibration frame for ten seconds, which no daemon has before its camera here",
    "reprocess 'archive/**/2026-03-*.grab'": "needs a cluster",
}
"""Examples whose words are checked, and that are not run; `check` is the one without anything else."""
JUDGING = {"check": {0, 3}, "test": {0, 3}, "calibrate": {0, 3}, "devices --check-field-order": {0, 3}}
"""Exit codes of commands that judge: what they say of these small captures is not the subject."""
ASKING = (
    *("status", "points", "trigger", "jobs", "check"),
    *("diagnostics --out", "capture --armed", "capture --together"),
)
"""Commands that ask the daemon at its usual address."""
CREATED_UTC = "2026-11-20T08:00:00.000Z"
CONFIG = "/etc/grabberd/grabberd.yaml"


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Daemon, Path]]:
    """One with one device, whose jobs stay in the queue."""
    folder = tmp_path_factory.mktemp("daemon")
    _make_archive(folder)
    with serving(folder, pace="real") as running:
        running.service.job_runner.stop()
        (folder / "token").write_text(running.service.access.add("barn", Role.ADMIN))
        yield running, folder


@pytest.fixture(scope="module")
def barn(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Daemon, Path]]:
    """One with several devices."""
    folder = tmp_path_factory.mktemp("barn")
    service = service_of(folder, {name: {"pace": "real"} for name in ("left", "right", "north")})
    with served(service) as running:
        wait_until_they_accept(service)
        (folder / "token").write_text(service.access.add("barn", Role.ADMIN))
        yield running, folder


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with everything that the examples name."""
    folder = tmp_path_factory.mktemp("prepared")
    configs = shipped_configs()
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("STATE_DIRECTORY", str(folder / "state"))
        patch.delenv("GRABBERD_URL", raising=False)
        _write_inputs(folder, configs)
        _make_captures(folder)
        liner = yaml.safe_load((configs / "profiles" / "liner-example-reference.yaml").read_text())
        for file, name in (("liner-A.yaml", "A"), ("profiles/liner-B.yaml", "B")):
            Path(file).write_text(yaml.safe_dump({**liner, "name": name}))
        _run("profile", "import", "--examples")
        _run("profile", "add", "liner-A.yaml")
        _make_archive(folder / "state")
        _run("storage", "index")
        _run("backup", "--out", "barn-2026-03-01.zip")
    return folder


def _write_inputs(folder: Path, configs: Path) -> None:
    shutil.copytree(configs, folder / "configs")
    simulated = yaml.safe_load((configs / "fake.yaml").read_text())
    simulated["devices"]["simulated"]["options"]["pace"] = "free"
    (folder / "configs" / "fake.yaml").write_text(yaml.safe_dump(simulated))
    for name, source in {
        "rig.calibration.json": configs / "fake.calibration.json",
        "liner-object.yaml": configs / "objects" / "liner.yaml",
        "liner-inputs.yaml": configs / "analysis" / "liner.yaml",
        "cow-112.yaml": configs / "profiles" / "cow-example-112.yaml",
        "truth.csv": example("object-truth.csv"),
    }.items():
        shutil.copy(source, folder / name)
    (folder / "profiles").mkdir()
    rows = [f"{n * 0.02:.2f},{42 if n % 30 < 15 else 0},42" for n in range(60)]
    (folder / "log.csv").write_text("\n".join(["time_s,pulsation_vacuum_kpa,liner_vacuum_kpa", *rows]))
    (folder / "film-inputs.yaml").write_text("agreement: {state: greatest, above: liner}")
    rows = [f"{-4 * n},{10 * (n % 5) - 20},{20 + n},1.5" for n in range(12)]
    (folder / "film.csv").write_text("\n".join(["along_mm,round_deg,pressure_kpa,sigma_kpa", *rows]))


def _make_captures(folder: Path) -> None:
    for name in ("frame", "object"):
        shutil.copy(example(f"{name}.grab"), folder)
    _run("capture", "--device", f"replay:{example('liner.grab')}", "--fields", "12", "--out", "liner.grab")
    _run("export", "frame.grab", "--format", "png", "--out", "frames")
    Path("frames/fields.csv").unlink()  # pictures of somebody else's, without a word on what they are
    for name in ("captures", "archive"):
        (folder / name).mkdir()
        shutil.copy("liner.grab", folder / name / "2026-03-01.grab")
    # Of few targets, with points: an analysis of these takes a tenth of the time.
    for name in ("b1", "b2", "b3", "ramp", "reference", "up-1", "up-2", "down-1", "down-2"):
        milking(folder, still(24), name, labels={"liner": "A"})
    (folder / ".grabberd-k3x9").mkdir()
    CaptureWriter.create(folder / ".grabberd-k3x9" / "liner.grab.part", meta()).close()
    for name in ("one", "two"):
        _run("analyse", "b1.grab", "--out", f"results/{name}")


def _make_archive(state: Path) -> None:
    """An archive with analysed captures of two liners on two cows."""
    (state / "captures").mkdir(parents=True)
    for number in range(4):
        name = f"c{number}"
        labels = {"liner": "AB"[number % 2], "cow": str(100 + number // 2), "milkings": str(100 * number)}
        write(state / "captures", slots(2), name=name, id=name, labels=labels, created_utc=CREATED_UTC)
        home = state / "analyses" / name / "1"
        home.mkdir(parents=True)
        value = {
            "name": COMPRESSION,
            "unit": "kPa",
            "value": 40.0 + number,
            "sigma": 1.0,
            "sigma_common": 0.8,
        }
        record = {"created_utc": CREATED_UTC, "pressure_method": "equilibrium", "quantities": [value]}
        (home / "record.json").write_text(json.dumps(record))
        (home / "report.json").write_text(json.dumps(report(name, 40.0 + number, labels=labels)))


def _run(*words: str) -> Result:
    result = CliRunner().invoke(app, list(words))
    assert result.exit_code == 0, (words, result.output, result.exception)
    return result


@pytest.fixture
def work(prepared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, a copy of the prepared folder."""
    shutil.copytree(prepared, tmp_path / "work")
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "work" / "state"))
    monkeypatch.delenv("GRABBERD_URL", raising=False)
    return tmp_path / "work"


@pytest.fixture
def stand_ins(
    request: pytest.FixtureRequest, work: Path, daemon: tuple[Daemon, Path], monkeypatch: pytest.MonkeyPatch
) -> dict[str, str]:
    """What the examples' configuration, addresses and ids stand for."""
    one: Example = request.node.callspec.params["one"]
    running, folder = daemon
    if one.starts("points --device", "trigger --device", "capture --together"):
        running, folder = request.getfixturevalue("barn")
    if one.starts(*ASKING):
        monkeypatch.setenv("GRABBERD_URL", running.url)
    if one.starts("diagnostics"):  # the daemon's user needs no token
        monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    else:
        shutil.copy(folder / "token", work)
        monkeypatch.setenv("GRABBERD_TOKEN_FILE", "token")
    of_daemon = one.starts("diagnostics --config")
    _write_config(work, running.url.rpartition(":")[2], folder if of_daemon else work / "state")
    return {
        CONFIG: str(work / "grabberd.yaml"),
        "http://barn.local:8050": running.url,
        "http://127.0.0.1:8050": running.url,
        "job-1772355731": _precede(one, running),
    }


def _precede(one: Example, running: Daemon) -> str:
    """Do what has to be done before an example works; return the id of a job."""
    if one.starts("token remove"):
        _run("token", "add", "tablet-north", "--role", "operator")
    if one.starts("storage seal"):
        Path("liner.grab").unlink()
    if one.starts("trigger"):
        device = "north" if "north" in one.text else None
        order = {"armed": True, "post_trigger_fields": 3, "device": device}
        Client(running.url, Path("token")).ask("/api/v1/captures", "POST", order)
    if one.starts("jobs"):
        return str(running.service.jobs.submit(MeasurementJob(subject="liner", made_with={})).id)
    return ""


def _write_config(work: Path, port: str, state: Path) -> None:
    config = yaml.safe_load((work / "configs" / "fake.yaml").read_text())
    device = config["devices"].pop("simulated")
    for key in ("calibration", "object"):
        device[key] = str(work / "configs" / device[key])
    config["devices"]["grabber"] = device
    config |= {"storage": {"directory": str(state)}, "http": {"port": int(port)}}
    (work / "grabberd.yaml").write_text(yaml.safe_dump(config))


@pytest.mark.parametrize("one", EXAMPLES, ids=str)
def test_an_example_works(one: Example, stand_ins: dict[str, str]) -> None:
    words = one.words(stand_ins)
    if _why_not_run(one):
        _parse(one, words)
        return
    if "--out" in words and one.command != ("reprocess",):
        Path(words[words.index("--out") + 1]).unlink(missing_ok=True)
    trigger = threading.Thread(target=_trigger_once, args=(stand_ins["http://127.0.0.1:8050"],))
    if one.starts("capture --armed"):
        trigger.start()
    result = CliRunner().invoke(app, words)
    if trigger.ident:
        trigger.join()
    allowed = next((codes for name, codes in JUDGING.items() if one.starts(name)), {0})
    assert result.exit_code in allowed, (result.output, result.exception)


@pytest.mark.parametrize("name", PARSED_ONLY)
def test_what_is_only_parsed_is_an_example_still(name: str) -> None:
    assert any(_is_of(one, name) for one in EXAMPLES)


def test_every_command_has_an_example() -> None:
    assert {one.command for one in EXAMPLES} == {name for name, _ in commands()}


def _why_not_run(one: Example) -> str | None:
    if "/dev/" in one.text:
        return "needs a device of its own"
    return next((reason for name, reason in PARSED_ONLY.items() if _is_of(one, name)), None)


def _is_of(one: Example, name: str) -> bool:
    """True for an example of this name; that of `check` is the one without anything else."""
    return one.text == f"grabberd {name}" or (name != "check" and one.starts(name))


def _parse(one: Example, words: list[str]) -> None:
    command = dict(commands())[one.command]
    command.make_context(one.command[-1], words[len(one.command) :])


def _trigger_once(url: str) -> None:
    """Triggers the armed capture as soon as there is one."""
    daemon, until = Client(url, Path("token")), time.monotonic() + 60
    while time.monotonic() < until:
        for row in daemon.ask("/api/v1/captures")["captures"]:
            if row["state"] == "armed":
                daemon.ask(f"/api/v1/captures/{row['id']}/trigger", "POST")
                return
