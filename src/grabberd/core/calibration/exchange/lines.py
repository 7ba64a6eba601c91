"""Lines of numbers in text files, with messages that name the line."""

from collections.abc import Iterator, Sequence

from grabberd.errors import InputError


class Lines:
    """Lines of a text, read one by one.

    Attributes:
        what: Description of the text for messages.
        number: Number of the line read last, from 1.
    """

    def __init__(self, text: str, what: str) -> None:
        self.what = what
        self.number = 0
        self._lines = text.splitlines()

    def next(self) -> str:
        """Read a line.

        Raises:
            InputError: There is none left.
        """
        if self.number >= len(self._lines):
            raise InputError(f"{self.what} ends after line {self.number}", "check that the file is complete")
        self.number += 1
        return self._lines[self.number - 1].strip()

    def numbers(self, least: int) -> list[float]:
        """Read the numbers of a line.

        Raises:
            InputError: There are fewer than `least`, or something else.
        """
        return self.as_numbers(self.next().split(), least)

    def as_numbers(self, words: Sequence[str], least: int) -> list[float]:
        """Convert the words of the line read last.

        Raises:
            InputError: There are fewer than `least`, or one is no number.
        """
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if len(values) < least:
            raise InputError(
                f"{self.what}, line {self.number}: expected {least} numbers, found {' '.join(words)[:60]!r}",
                "check that the file is of the kind that is read",
            )
        return values

    def rest(self) -> Iterator[str]:
        """Read the other lines; those that are empty or begin with # are skipped."""
        while self.number < len(self._lines):
            line = self.next()
            if line and not line.startswith("#"):
                yield line

    def block(self, least: int) -> Iterator[list[float]]:
        """Read lines of numbers up to an empty line or the end."""
        while self.number < len(self._lines) and (line := self.next()):
            yield self.as_numbers(line.split(), least)
