"""Examples of the commands' help: found, and made into words that a test can run."""

import re
import shlex
from collections.abc import Iterator
from glob import glob
from typing import Any, NamedTuple

import typer

from grabberd.cli.app import app

SHORTEST = {"--fields": "6", "--duration-s": "0.5", "--seconds": "0.5", "--pre-trigger": "2", "--field": "5"}
"""Lengths and numbers of fields in place of those of a milking."""
ADDED = {
    "test milking": ["--duration-s", "0.5"],
    "logger vacuum": ["--seconds", "0.5"],
    "points --device": ["--fields", "3"],
    "reprocess captures/": ["--workers", "1"],
}
"""What makes an example short that names no length."""


class Example(NamedTuple):
    """An example as the help shows it.

    Attributes:
        command: Names of the command that shows it.
        text: The line that a person types, from `grabberd` on.
    """

    command: tuple[str, ...]
    text: str

    def __str__(self) -> str:
        return self.text

    def starts(self, *beginnings: str) -> bool:
        """True if it begins with one of these words after `grabberd`."""
        return any(f"{self.text} ".startswith(f"grabberd {one} ") for one in beginnings)

    def words(self, stand_ins: dict[str, str], *, shorter: bool = True) -> list[str]:
        """What follows `grabberd`, as a shell takes it in the working directory, without redirections."""
        typed = self.text.partition(" > ")[0]
        for written, meant in stand_ins.items():
            typed = typed.replace(written, meant)
        words = [word for part in shlex.split(typed, posix=False)[1:] for word in _as_shell(part)]
        if shorter:
            words += next((more for one, more in ADDED.items() if self.starts(one)), [])
            words = [SHORTEST.get(before, word) for before, word in zip(["", *words], words, strict=False)]
        return words


def examples() -> list[Example]:
    """All of all commands, in the order of the help."""
    return [
        Example(names, text.removeprefix("sudo "))
        for names, command in commands()
        for text in re.findall(r"Example: (.*?)(?:\n\n|\Z)", _lines_joined(command.help or ""), re.S)
    ]


def commands() -> Iterator[tuple[tuple[str, ...], Any]]:
    """All commands with their names, those of groups included."""
    for name, command in typer.main.get_command(app).commands.items():  # type: ignore[attr-defined]
        inner = getattr(command, "commands", None)
        if inner is None:
            yield (name,), command
        else:
            yield from (((name, one), inner[one]) for one in inner)


def _lines_joined(text: str) -> str:
    return re.sub(r"(?<!\n)\n(?!\n)[ \t]*", " ", text)


def _as_shell(word: str) -> list[str]:
    if word[:1] in "'\"":
        return [word[1:-1]]
    return sorted(glob(word)) or [word] if "*" in word else [word]
