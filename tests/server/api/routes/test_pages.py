"""Pages of a list: what is read for one, where it ends, and how the next one goes on."""

import pytest

from grabberd.documents.document import JobProblem
from grabberd.server.api.routes.dependencies import by_number, page_of

MEGABYTE = 1 << 20


def row(number: int, hint: str = "") -> JobProblem:
    return JobProblem(message=str(number), hint=hint)


def pages(
    known: list[int], limit: int, hint: str = "", odd: bool = False, ascending: bool = False
) -> list[list[int]]:
    """Numbers of all pages; odd ones alone, if wanted."""
    found, cursor = [], None
    while True:
        page, cursor = page_of(
            known,
            by_number,
            lambda number: None if odd and not number % 2 else row(number, hint),
            limit,
            cursor,
            ascending=ascending,
        )
        found.append([int(one.message) for one in page])
        if cursor is None:
            return found


@pytest.mark.parametrize(("ascending", "expected"), [(False, [[10, 9], [2, 1]]), (True, [[1, 2], [9, 10]])])
def test_every_entry_is_on_one_page(ascending: bool, expected: list[list[int]]) -> None:
    assert pages([2, 10, 1, 9], 2, ascending=ascending) == expected


def test_a_page_ends_early_if_its_rows_are_large() -> None:
    assert pages([1, 2, 3, 4, 5], 500, hint="x" * (3 * MEGABYTE // 2)) == [[5, 4], [3, 2], [1]]


def test_one_row_is_shown_however_large_it_is() -> None:
    assert pages([1, 2], 500, hint="x" * (5 * MEGABYTE)) == [[2], [1]]


def test_what_does_not_belong_to_the_list_leaves_no_empty_page() -> None:
    assert pages([1, 2, 3, 4, 5, 6], 2, odd=True) == [[5, 3], [1]]
    assert pages([2, 4], 2, odd=True) == [[]]


def test_the_rows_of_the_page_alone_are_read() -> None:
    read = []

    def reading(number: int) -> JobProblem:
        read.append(number)
        return row(number)

    page_of(range(1000), by_number, reading, 2, None)
    assert read == [999, 998, 997]
