"""How commands end: without room or a reader for their output, interrupted, or by an error of their own."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize("words", [["--help"], ["plan", "--help"], ["export", "--help"]])
def test_output_that_finds_no_room_is_a_line_and_no_traceback(words: list[str]) -> None:
    command = [sys.executable, "-c", "from grabberd.cli import main; main()", *words]
    with open("/dev/full", "w") as full:
        ended = subprocess.run(command, check=False, stdout=full, stderr=subprocess.PIPE, text=True)
    assert ended.returncode == 74
    assert ended.stderr.splitlines()[0] == "grabberd: the output cannot be written: No space left on device"
    assert len(ended.stderr.splitlines()) == 2


def test_output_that_nobody_reads_ends_without_a_word() -> None:
    read, write = os.pipe()
    os.close(read)
    command = [sys.executable, "-c", "from grabberd.cli import main; main()", "--help"]
    ended = subprocess.run(command, check=False, stdout=write, stderr=subprocess.PIPE, text=True)
    os.close(write)
    assert (ended.returncode, ended.stderr) == (1, "")


_INTERRUPTED_IMPORT = """
import os, signal, sys, types
from grabberd.cli import main
signal.signal(signal.SIGINT, signal.{before})

class Importing(types.ModuleType):
    def __getattr__(self, name):
        try:
            os.kill(os.getpid(), signal.SIGINT)
        except KeyboardInterrupt:
            raise ValueError("a library's own words for it")
        return lambda: print("done")

sys.modules["grabberd.cli.app"] = Importing("grabberd.cli.app")
main()
"""


def interrupted_while_it_imports(before: str) -> tuple[int, str, str]:
    command = [sys.executable, "-c", _INTERRUPTED_IMPORT.format(before=before)]
    ended = subprocess.run(command, check=False, capture_output=True, text=True)
    return ended.returncode, ended.stdout, ended.stderr


def test_a_command_that_is_interrupted_before_it_has_begun_says_so_whatever_is_being_imported() -> None:
    assert interrupted_while_it_imports("default_int_handler") == (130, "", "grabberd: interrupted\n")


def test_a_command_that_is_interrupted_at_work_says_so() -> None:
    code = """
import os, signal
from grabberd.cli import main
from grabberd.cli.app import app

@app.command()
def works():
    os.kill(os.getpid(), signal.SIGINT)

main()
"""
    ended = subprocess.run([sys.executable, "-c", code, "works"], check=False, capture_output=True, text=True)
    assert (ended.returncode, ended.stderr.strip()) == (130, "grabberd: interrupted")


BROKEN = """
import typer
from grabberd.cli import app, main

@app.app.command()
def broken():
    raise RuntimeError("two\\nlines")

main()
"""


def test_an_error_of_the_program_itself_is_a_sentence_and_a_file_with_the_traceback(tmp_path: Path) -> None:
    variables = {**os.environ, "TMPDIR": str(tmp_path)}
    variables.pop("JOURNAL_STREAM", None)
    command = [sys.executable, "-c", BROKEN, "broken"]
    ended = subprocess.run(command, check=False, capture_output=True, text=True, env=variables)
    (kept,) = tmp_path.glob("grabberd-error-*.txt")
    assert ended.returncode == 70
    said = "grabberd: internal error: RuntimeError: two lines\nhint: this is a bug in grabberd; please "
    assert ended.stderr == f"{said}report it with the file {kept}\n"
    assert "in broken" in kept.read_text()


def test_a_service_tells_the_journal_of_an_error_of_its_own() -> None:
    variables = {**os.environ, "JOURNAL_STREAM": "8:1"}
    command = [sys.executable, "-c", BROKEN, "broken"]
    ended = subprocess.run(command, check=False, capture_output=True, text=True, env=variables)
    assert ended.returncode == 70
    assert "Traceback (most recent call last)" in ended.stderr


def test_a_command_that_was_started_with_interrupts_ignored_goes_on_ignoring_them() -> None:
    assert interrupted_while_it_imports("SIG_IGN") == (0, "done\n", "")


def test_hardly_anything_is_imported_before_an_interrupt_is_a_line() -> None:
    listed = "import sys; before = set(sys.modules); import grabberd.cli; print(*set(sys.modules) - before)"
    ended = subprocess.run([sys.executable, "-c", listed], check=True, capture_output=True, text=True)
    ours = {name for name in ended.stdout.split() if name.startswith("grabberd")}
    assert ours == {"grabberd", "grabberd.cli"}
