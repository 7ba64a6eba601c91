"""`grabberd schema`: prints the JSON Schema of a file's form."""

from typing import Annotated

import typer


def schema(
    name: Annotated[
        str | None, typer.Argument(help="Kind of file; without it the names are listed.", show_default=False)
    ] = None,
) -> None:
    """Print the JSON Schema of a file format, for editors and other programs.

    Example: grabberd schema configuration > configuration.schema.json
    """
    from grabberd.cli.options import print_json  # noqa: PLC0415
    from grabberd.errors import NotFound  # noqa: PLC0415
    from grabberd.schemas import known_forms, schema_of  # noqa: PLC0415

    if name is None:
        for known, form in known_forms().items():
            typer.echo(f"{known:20} {form.title}")
        return
    if name not in known_forms():
        raise NotFound(f"there is no schema {name!r}", f"name one of: {', '.join(known_forms())}")
    print_json(schema_of(name))
