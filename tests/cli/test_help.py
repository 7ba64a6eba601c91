"""Every command says what it does and shows how; the reference has them all."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from cli.examples import commands
from grabberd import __version__
from grabberd.cli.app import app

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
REFERENCE = (ROOT / "docs" / "reference" / "commands.md").read_text(encoding="utf-8")
COMMANDS: dict[str, Any] = typer.main.get_command(app).commands  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_a_command_is_in_the_reference(name: str) -> None:
    assert re.search(rf"^## grabberd {name}\b", REFERENCE, re.MULTILINE)


@pytest.mark.parametrize("name", sorted(COMMANDS))
def test_its_help_shows_an_example(name: str) -> None:
    command = COMMANDS[name]
    inner = getattr(command, "commands", {"": command}).values()
    for one in inner:
        assert re.search(rf"Example: grabberd {name}\b", one.help or ""), one.name


@pytest.mark.parametrize(("kernel", "lines"), [(object(), 1), (None, 2)])
def test_the_version_says_what_is_slower_without_a_compiled_kernel(
    kernel: object, lines: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd.core.kernel.KERNEL", kernel)
    said = CliRunner().invoke(app, ["--version"]).stdout.splitlines()
    assert len(said) == lines
    assert said[0].startswith(f"grabberd {__version__} (")
    assert all("no compiled kernel" in line for line in said) == (kernel is None)


def test_the_readme_is_one_screen_or_two() -> None:
    assert len(README.splitlines()) <= 60


WRITING = {
    *("capture", "frame", "calibrate", "analyse", "study", "test", "export", "render", "reprocess"),
    *("inspect", "diagnostics", "backup", "new", "profile export"),
}
"""Commands that write a file or a folder of the user's choice."""


def test_whatever_writes_names_its_file_or_folder_in_the_same_way() -> None:
    found = {
        " ".join(names): option
        for names, command in commands()
        for option in command.params
        if "--out" in option.opts
    }
    assert set(found) == WRITING
    for name, option in found.items():
        assert option.opts == ["--out", "-o"], name
        assert option.help.startswith(("New file to write: ", "New or empty folder to write: ")), name


def test_no_command_takes_what_it_writes_by_its_place() -> None:
    for _, command in commands():
        assert not [one for one in command.params if one.name == "out" and one.param_type_name == "argument"]


def test_it_also_runs_as_a_module_of_python() -> None:
    for words, code in ((["--version"], 0), (["--help"], 0), (["no-such-command"], 2)):
        command = [sys.executable, "-m", "grabberd", *words]
        assert subprocess.run(command, capture_output=True, check=False).returncode == code


def test_help_comes_before_anything_that_computes_is_loaded() -> None:
    heavy = {"numpy", "cv2", "scipy", "fastapi", "pydantic", "yaml"}
    code = f"import sys, grabberd.cli.app; print(sorted({heavy} & set(sys.modules)))"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == "[]\n"


@pytest.mark.parametrize(
    "words", [("export", "x.grab", "--format", "foo"), ("token", "add", "barn", "--role", "foo")]
)
def test_a_value_that_is_no_choice_is_named_without_the_words_of_what_checks_it(
    words: tuple[str, ...],
) -> None:
    told = CliRunner().invoke(app, words, env={"TERM": "dumb", "COLUMNS": "200"}).output
    assert "Invalid value for" in told
    assert "'foo' is not one of '" in told
    assert "Value error" not in told
