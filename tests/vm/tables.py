"""Tables of what the tests found, for the terminal and for the documentation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

KERNEL = """# Under a real kernel

Written by `make test-vm WRITE=1`: a virtual machine with Debian's own kernel, whose test driver `vivid` is a
grabber that can be told to fail. Times are the guest's, whose clock follows its own instructions, so the
host's load is not in them.
"""
SYSTEMD = """# Under a real systemd

Written by `make test-vm WRITE=1`: a virtual machine with Debian 12, into which the installer has put the
service from a bundle. It captures from the kernel's test driver, within its sandbox, started by systemd
through its socket; captures lie on a disk of their own, ext4 with a journal. Times are the guest's, whose
clock follows its own instructions; its processor takes twenty times as long over the start of Python as a
real one.
"""


@dataclass
class Table:
    """Rows below a heading; each row maps all columns to words."""

    title: str
    columns: Sequence[str]
    note: str = ""
    rows: list[Mapping[str, str]] = field(default_factory=list)

    def lines(self) -> Iterator[str]:
        """In Markdown, columns as wide as their widest word."""
        cells = [list(self.columns), *([row[column] for column in self.columns] for row in self.rows)]
        widths = [max(len(row[index]) for row in cells) for index in range(len(self.columns))]
        rule = ["-" * width for width in widths]
        for row in (cells[0], rule, *cells[1:]):
            yield "| " + " | ".join(word.ljust(width) for word, width in zip(row, widths, strict=True)) + " |"


class Tables:
    """Those of one run, in the order in which they were begun."""

    def __init__(self, introduction: str) -> None:
        self._introduction = introduction
        self._tables: dict[str, Table] = {}

    def add(self, title: str, note: str = "", **cells: object) -> None:
        """A row of a table; underscores in the columns' names are spaces."""
        row = {name.replace("_", " "): str(word) for name, word in cells.items()}
        table = self._tables.setdefault(title, Table(title, tuple(row), note))
        table.rows.append(row)

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._tables)

    def lines(self) -> Iterator[str]:
        """For the terminal."""
        for table in self._tables.values():
            yield from ("", table.title, *table.lines())

    def document(self) -> str:
        """For the documentation."""
        parts = [self._introduction]
        for table in self._tables.values():
            note = f"{table.note}\n\n" if table.note else ""
            parts.append(f"## {table.title}\n\n{note}" + "\n".join(table.lines()) + "\n")
        return "\n".join(parts)
