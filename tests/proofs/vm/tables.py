"""Tables of what the tests found, for the terminal and for the documentation."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

KERNEL = """# Under a real kernel

Made by `make test-vm WRITE=1`; do not edit. A virtual machine runs Debian's own kernel, whose test driver
`vivid` acts as a grabber with faults on request, and whose drivers of real grabbers have emulated ones before
them. Times are the guest's, whose clock is driven by its instruction count, so they do not depend on the
host's load.
"""
SYSTEMD = """# Under a real systemd

Made by `make test-vm WRITE=1`; do not edit. A virtual machine runs Debian 12, with the service installed from
a bundle. The service runs in its sandbox, started by systemd through its socket, and captures from the
kernel's test driver onto a separate disk (ext4 with a journal). Times are the guest's, whose clock is driven
by its instruction count; starting Python takes twenty times as long there as on a real processor.
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

    def add_beside(self, title: str, of: str, note: str = "", **cells: object) -> None:
        """The same of another case `of` what was added before: one row where nothing else differs.

        Where something does, the row follows that of the other case, which has the same words up to `of`.
        """
        self.add(title, note, **cells)
        rows = self._tables[title].rows
        row = rows.pop()
        same = [name for name in row if name != of]
        alike = list(row)[: list(row).index(of)]
        for index, other in enumerate(rows):
            if all(other[name] == row[name] for name in same):
                rows[index] = {**other, of: f"{other[of]}, {row[of]}"}
                return
        near = [k for k, other in enumerate(rows) if all(other[name] == row[name] for name in alike)]
        rows.insert(near[-1] + 1 if near else len(rows), row)

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
