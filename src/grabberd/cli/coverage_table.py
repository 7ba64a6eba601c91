"""Coverage of a run for the terminal: the verdict, its reasons, and the worst targets."""

from typing import TYPE_CHECKING

import typer
from rich.table import Table

from grabberd.cli.options import VERDICTS
from grabberd.cli.terminal import console

if TYPE_CHECKING:
    from grabberd.documents.coverage import CoverageDocument, TargetCoverage

SHOWN = 10
"""Number of targets listed, the worst first; --json has all."""


def print_coverage(coverage: "CoverageDocument") -> None:
    """Print the verdict with its findings, then the targets that were missed most."""
    for finding in coverage.findings:
        typer.echo(f"{VERDICTS[finding.verdict]}: {finding.in_words}")
    missed = [one for one in coverage.targets if one.found < one.expected]
    if missed:
        console.print(_table(sorted(missed, key=_share)[:SHOWN]))
    if len(missed) > SHOWN:
        typer.echo(f"and {len(missed) - SHOWN} more targets that were missed at times; --json lists all")


def _table(targets: "list[TargetCoverage]") -> Table:
    table = Table("target", "found", "of", "share", "mostly because")
    for one in targets:
        table.add_row(
            str(one.target), str(one.found), str(one.expected), f"{int(100 * _share(one))} %", one.in_words
        )
    return table


def _share(target: "TargetCoverage") -> float:
    return target.found / target.expected
