"""The page of commands, from their own help; `generate.py` writes it."""

import re
from collections.abc import Iterator
from typing import Any

from typer.main import get_command

from grabberd.cli.app import app

MADE = "<!-- made by `make docs`; do not edit -->\n"
COMMANDS_BEFORE = """\
The output of `grabberd COMMAND --help`. Exit codes: 0 success; 1 failure, explained by the message; 2 invalid
command line; 3 a bad verdict, from the commands that give one; 70 internal error of grabberd; 74 the daemon
cannot write to its disk, or a command cannot write its output; 78 invalid configuration. Some commands have
further ones."""


def page() -> str:
    """The page's Markdown."""
    return "\n".join(_commands()) + "\n"


def _commands() -> Iterator[str]:
    yield f"{MADE}# Commands\n"
    yield COMMANDS_BEFORE
    for name, command in sorted(get_command(app).commands.items()):  # type: ignore[attr-defined]
        for inner, one in getattr(command, "commands", {"": command}).items():
            yield f"\n## grabberd {name} {inner}".rstrip() + "\n"
            yield from _command(one)


def _one_paragraph(example: str) -> str:
    if "\n\n" in example.strip():
        raise ValueError(f"examples come last in a command's help, but text follows this one: {example}")
    return " ".join(example.split())


def _command(command: Any) -> Iterator[str]:
    words, *examples = re.split(r"Example: ", command.help or "")
    yield words.strip() + "\n"
    yield from (f"    {_one_paragraph(example)}" for example in examples)
    yield "\n| | |\n|---|---|"
    for one in command.params:
        if one.name != "help":
            shown = ", ".join(f"`{name}`" for name in [*one.opts, *one.secondary_opts])
            named = shown if one.param_type_name == "option" else f"`{one.name.upper()}`"
            yield f"| {named} | {' '.join((one.help or '').split()).replace('|', '/')} |"
