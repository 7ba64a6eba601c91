"""The terminal: tables for results, bars for progress. Apart from the options, since a daemon has neither."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import Progress

console = Console()
"""Standard output, for results."""
progress_console = Console(stderr=True)
"""Standard error, for progress, so that results can be piped."""


@contextmanager
def progress_bar(description: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar for the duration of the block, which reports the share done, 0 to 1."""
    with Progress(console=progress_console, transient=True) as progress:
        task = progress.add_task(description, total=1.0)
        yield lambda share: progress.update(task, completed=share)
