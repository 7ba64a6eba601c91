"""The Jinja2 environment of the liner's reports: the program's, with templates and figures of its own."""

from functools import cache

from jinja2 import ChoiceLoader, PackageLoader

from grabberd.reports import document as program
from grabberd_liner.reports import figures


@cache
def environment() -> program.DocumentEnvironment:
    """Return the one environment, whose own templates win over the program's."""
    loaders = [PackageLoader("grabberd_liner.reports"), PackageLoader("grabberd.reports")]
    made = program.environment().overlay(loader=ChoiceLoader(loaders))
    made.globals = {**made.globals, **program.figures_in(figures)}
    return made
