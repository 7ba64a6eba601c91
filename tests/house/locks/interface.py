"""The HTTP API's description, the help of every command, and the schemas of files."""

import json
import re
from collections.abc import Iterator
from typing import Any

from typer.testing import CliRunner

from .doors import app, click_commands, openapi

WIDTH = 100
PLAIN = {"COLUMNS": str(WIDTH), "TERM": "dumb", "NO_COLOR": "1", "LC_ALL": "C.UTF-8"}
_ESCAPE = re.compile(r"\x1b\[[0-9;]*m")


def http() -> Any:
    """The whole OpenAPI document."""
    return openapi()


def help_texts() -> dict[str, list[str]]:
    """Lines of `grabberd … --help`, by the names of the command; without blanks at their ends."""
    return {" ".join(("grabberd", *names)): _help(names) for names in _commands()}


def schemas() -> dict[str, Any]:
    """What `grabberd schema` lists and prints."""
    listed = _printed("schema")
    kinds = [line.split()[0] for line in listed.splitlines()]
    return {"": listed.splitlines(), **{kind: json.loads(_printed("schema", kind)) for kind in kinds}}


def _commands() -> Iterator[tuple[str, ...]]:
    yield ()
    for name, command in sorted(click_commands().items()):
        yield (name,)
        yield from ((name, inner) for inner in sorted(getattr(command, "commands", ())))


def _help(names: tuple[str, ...]) -> list[str]:
    return [line.rstrip() for line in _ESCAPE.sub("", _printed(*names, "--help")).splitlines()]


def _printed(*words: str) -> str:
    done = CliRunner().invoke(app, list(words), env=PLAIN, prog_name="grabberd", catch_exceptions=False)
    assert done.exit_code == 0, f"grabberd {' '.join(words)} ends with {done.exit_code}"
    return done.stdout
