"""A kit works from the first minute: made in an empty folder, installed, tested, and taking a capture."""

import json
import os
import re
import subprocess
import sys
import venv
from collections.abc import Callable
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import grabberd
import grabberd_fake
from grabberd.cli.app import app
from grabberd.errors import GrabberdError, InputError, StorageError

ROOT = Path(__file__).parents[2]
KINDS = ("driver", "logger", "locator")
Run = Callable[..., str]


def make(*words: object) -> Result:
    result = CliRunner().invoke(app, ["new", *map(str, words)])
    if isinstance(result.exception, GrabberdError):
        raise result.exception
    assert result.exit_code == 0, result.output
    return result


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Runs Python in a new environment, with grabberd as it is here and nothing from a network."""
    pytest.importorskip("hatchling", reason="pip install 'grabberd[test]'")
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=True, system_site_packages=True, symlinks=True)
    own = [str(Path(package.__path__[0]).parent) for package in (grabberd, grabberd_fake)]
    elsewhere = [path for path in sys.path if (Path(path) / "hatchling").is_dir() or "site-packages" in path]
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([*own, *elsewhere]),
        "PIP_NO_INDEX": "1",
        "PIP_DISABLE_PIP_VERSION_CHECK": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }

    def python(*words: object, cwd: Path) -> str:
        done = subprocess.run(
            [str(folder / "bin" / "python"), *map(str, words)],
            cwd=cwd,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return python


def grabberd_command(run: Run, folder: Path, *words: object) -> str:
    return run("-c", "from grabberd.cli import main; main()", *words, cwd=folder)


@pytest.fixture(scope="module")
def installed(run: Run, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A kit of each kind, by its name, made and installed."""
    folder = tmp_path_factory.mktemp("kits")
    made = {kind: folder / f"grabberd-barn-{kind}" for kind in KINDS}
    for kind, kit in made.items():
        make(kind, f"barn_{kind}", "--out", kit)
    editable = [word for kit in made.values() for word in ("-e", kit)]
    run("-m", "pip", "install", "-q", "--no-deps", "--no-build-isolation", *editable, cwd=folder)
    return made


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_its_own_tests_pass(run: Run, installed: dict[str, Path], kind: str) -> None:
    said = run("-m", "pytest", "-q", "-p", "no:cacheprovider", cwd=installed[kind])
    assert " passed" in said
    assert "failed" not in said


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_capture_is_complete_with_it(
    run: Run, installed: dict[str, Path], kind: str, tmp_path: Path
) -> None:
    config, out = installed[kind] / f"barn_{kind}.yaml", tmp_path / "first.grab"
    # The simulated grabber waits for its reader, however busy the computer; a logger's readings would not.
    pace = ("--option", "pace=free") if kind == "locator" else ()
    said = grabberd_command(
        run, tmp_path, "capture", "--config", config, *pace, "--fields", 48, "--out", out, "--json"
    )
    document = json.loads(said)
    assert document["verdict"] == "complete", said
    if kind == "logger":
        assert document["channels"] | {"in_words": ""} == {
            "names": ["pulsation"],
            "verdict": "complete",
            "in_words": "",
        }
    if kind == "locator":
        (measured,) = document["runs"]
        assert measured["coverage"]["verdict"] == "measured_well"
        with grabberd.open(out) as capture:
            assert capture.meta.config["location"]["method"] == "barn_locator"


@pytest.mark.slow
def test_a_made_logger_is_heard(run: Run, installed: dict[str, Path], tmp_path: Path) -> None:
    config = installed["logger"] / "barn_logger.yaml"
    said = grabberd_command(run, tmp_path, "logger", "barn_logger", "--config", config, "--seconds", 1)
    assert "vacuum" in said


@pytest.mark.parametrize("kind", KINDS)
def test_a_kit_keeps_the_rules_of_the_source(kind: str, tmp_path: Path) -> None:
    make(kind, "mycard", "--out", tmp_path / "kit")
    for command in (("check", "--select", "E,F,W,I,N,B,UP,PT,SIM,RET"), ("format", "--check")):
        words = [sys.executable, "-m", "ruff", *command, "--isolated", "--line-length", "110", "--no-cache"]
        done = subprocess.run(
            [*words, "."], cwd=tmp_path / "kit", capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("kind", KINDS)
def test_a_kit_is_called_by_its_name_everywhere(kind: str, tmp_path: Path) -> None:
    make(kind, "two_words", "--out", tmp_path / "kit")
    files = [path for path in (tmp_path / "kit").rglob("*") if path.is_file()]
    assert {"pyproject.toml", "README.md", "two_words.yaml", "test_two_words.py"} <= {f.name for f in files}
    for file in files:
        text = file.read_text()
        assert "$" not in text
        assert "PACKAGE" not in f"{file} {text}"
    assert "class TestTwoWords" in (tmp_path / "kit" / "tests" / "test_two_words.py").read_text()


def test_the_folder_is_called_after_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    document = json.loads(make("driver", "my_card", "--json").stdout)
    assert document["folder"] == "grabberd-my-card"
    assert (tmp_path / "grabberd-my-card" / "src" / "grabberd_my_card" / "grabber.py").is_file()


@pytest.mark.parametrize("name", ["", "My", "2nd", "a-b", "class", "a.b", "../x", "é", "a" * 40])
def test_a_name_that_python_does_not_take_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be the name of a driver"):
        make("driver", name, "--out", tmp_path / "kit")
    assert not (tmp_path / "kit").exists()


@pytest.mark.parametrize(
    ("kind", "name"),
    [("driver", "v4l2"), ("logger", "serial"), ("locator", "template"), ("locator", "automatic")],
)
def test_a_name_that_is_taken_is_refused_with_those_that_are(kind: str, name: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"there is a {kind} '{name}' already") as caught:
        make(kind, name, "--out", tmp_path / "kit")
    assert name in caught.value.hint


def test_a_package_that_is_there_is_not_hidden(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="Python package grabberd_loggers"):
        make("driver", "loggers", "--out", tmp_path / "kit")


def test_an_empty_folder_is_filled(tmp_path: Path) -> None:
    make("driver", "mycard", "-o", tmp_path)
    assert (tmp_path / "pyproject.toml").is_file()


def test_nothing_is_written_over(tmp_path: Path) -> None:
    make("driver", "mycard", "--out", tmp_path / "kit")
    with pytest.raises((InputError, StorageError)):
        make("driver", "mycard", "--out", tmp_path / "kit")


@pytest.mark.parametrize("kind", KINDS)
def test_the_guide_has_the_commands_of_the_kit(kind: str, tmp_path: Path) -> None:
    guide = (ROOT / "docs" / "howto" / f"write-a-{kind}.md").read_text()
    (name,) = re.findall(rf"^    grabberd new {kind} (\w+)", guide, re.MULTILINE)
    make(kind, name, "--out", tmp_path / "kit")
    readme = (tmp_path / "kit" / "README.md").read_text()
    assert set(commands(readme)) <= set(commands(guide))
    files = {path.name for path in (tmp_path / "kit").rglob("*")}
    assert set(re.findall(r"`(\w+\.py)`", guide)) <= files


def commands(page: str) -> list[str]:
    """The commands in a page's indented blocks, without comments."""
    lines = re.findall(r"^    ((?:pip|pytest|grabberd) ?.*)$", page, re.MULTILINE)
    return [line.split("   #")[0].strip() for line in lines]
