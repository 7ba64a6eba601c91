"""`grabberd new`: writes an installable package to begin a driver, a logger or a locator with."""

import re
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from string import Template
from typing import Annotated, Literal

import typer

from grabberd.cli.options import JsonOption, check_absent, check_folder, out_folder, print_result
from grabberd.errors import InputError

Kind = Literal["driver", "logger", "locator"]
KITS = Path(__file__).parent / "kits"
"""Templates of the packages' files, a folder for each kind; NAME and PACKAGE in their paths are replaced."""
SUFFIX = ".template"
_NAME = re.compile(r"[a-z][a-z0-9_]{0,31}")
_KINDS: Mapping[Kind, str] = {
    "driver": "driver of a grabber",
    "logger": "driver of a logger",
    "locator": "locator",
}


def new(
    kind: Annotated[Kind, typer.Argument(help="What to create.")],
    name: Annotated[str, typer.Argument(help="Name to use in the configuration.")],
    out: Annotated[Path | None, out_folder("the package; default: grabberd-NAME")] = None,
    json: JsonOption = False,
) -> None:
    """Create a package for a driver, a logger or a locator, which works and passes the contract tests.

    Example: grabberd new driver mycard

    Example: grabberd new locator gaussian --out gaussian
    """
    from grabberd.files.disk import storage_errors  # noqa: PLC0415

    check_name(kind, name)
    words = words_of(name)
    folder = (out or Path(words["DISTRIBUTION"])).expanduser()
    check_folder(folder)
    if not (folder.is_dir() and not any(folder.iterdir())):
        check_absent(folder)
    made = dict(files(kind, words))
    with storage_errors(folder):
        for path, text in made.items():
            file = folder / path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text, encoding="utf-8")
    said = f"{folder}: a working {_KINDS[kind]}; next, run"
    said += f"\n  pip install -e '{folder}[test]'\n  pytest {folder}"
    print_result({"folder": str(folder), "files": sorted(made)}, said, as_json=json)


def files(kind: Kind, words: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Path, within the folder, and text of every file of a kit.

    Args:
        kind: Which kit.
        words: As `words_of` has them.
    """
    for template in sorted((KITS / kind).rglob(f"*{SUFFIX}")):
        path = template.relative_to(KITS / kind).as_posix().removesuffix(SUFFIX)
        path = path.replace("PACKAGE", words["PACKAGE"]).replace("NAME", words["NAME"])
        yield path, Template(template.read_text(encoding="utf-8")).substitute(words)


def words_of(name: str) -> dict[str, str]:
    """Words that the templates are filled with, from the name."""
    from grabberd.config import shipped_configs  # noqa: PLC0415 - loads pydantic

    return {
        "NAME": name,
        "PACKAGE": f"grabberd_{name}",
        "DISTRIBUTION": f"grabberd-{name.replace('_', '-').strip('-')}",
        "CLASS": "".join(part.capitalize() for part in name.split("_")),
        "CONFIGS": str(shipped_configs()),
    }


def check_name(kind: Kind, name: str) -> None:
    """Check that a name can be that of a package, and that nothing else has it.

    Raises:
        InputError: It cannot, or something has it.
    """
    if not _NAME.fullmatch(name) or iskeyword(name):
        raise InputError(
            f"{name!r} cannot be the name of a {kind}",
            "use lower-case letters, digits and underscores, a letter first, no Python keyword: mycard",
        )
    taken = _taken(kind)
    if name in taken:
        raise InputError(
            f"there is a {kind} {name!r} already", f"choose a name other than {', '.join(taken)}"
        )
    if find_spec(f"grabberd_{name}") is not None:
        raise InputError(
            f"there is a Python package grabberd_{name} already",
            "choose another name, or uninstall that package first",
        )


def _taken(kind: Kind) -> tuple[str, ...]:
    from grabberd.archive.measure_setups import INSTALLED_LOCATORS  # noqa: PLC0415 - loads numpy
    from grabberd.core.measurement import METHODS  # noqa: PLC0415
    from grabberd.instrument.acquisition import GRABBERS, LOGGERS  # noqa: PLC0415 - loads numpy

    if kind == "locator":
        return (*METHODS, *INSTALLED_LOCATORS.available())
    return (GRABBERS if kind == "driver" else LOGGERS).available()
