"""Captures in memory are searched, counted and sorted by one question."""

from dataclasses import replace
from zoneinfo import ZoneInfo

import pytest

from grabberd.archive.catalogue.capture_catalogue import MOST_VALUES, CaptureCatalogue, Count, Row
from grabberd.archive.catalogue.capture_query import CaptureQuery, Order, Position
from grabberd.errors import InputError

OSLO = ZoneInfo("Europe/Oslo")
ALL = CaptureQuery()
PLAIN = Row("", "", "barn", "complete", False, False, "cal-1", True, 250, 0, 1000, "", {})


def row(own_id: str, day: int = 1, **changes: object) -> Row:
    return PLAIN._replace(id=own_id, created_utc=f"2026-03-{day:02}T09:00:00.000Z", **changes)


@pytest.fixture
def catalogue() -> CaptureCatalogue:
    made = CaptureCatalogue()
    made.replace(
        [
            row("a", 1, labels={"cow": "9", "liner": "old"}, losses=3, length=100),
            row("b", 2, labels={"cow": "10", "liner": "old"}, verdict="incomplete", analysed=True),
            row(
                "c",
                3,
                labels={"cow": "112", "liner": "new"},
                pinned=True,
                calibration="cal-2",
                note="Slipped Ølst",
            ),
            row("d", 4, labels={}, verdict="damaged", calibration="", measured=False, length=-1, losses=-1),
        ]
    )
    return made


def test_the_number_of_a_cow_is_not_looked_for_in_the_times_of_ids(catalogue: CaptureCatalogue) -> None:
    catalogue.change([], [row("20261126T090000000Z-barn", 5)])
    assert ids(catalogue, search="112") == ["c"]
    assert ids(catalogue, search="20261126t") == ["20261126T090000000Z-barn"]


def ids(catalogue: CaptureCatalogue, **query: object) -> list[str]:
    return catalogue.ask(replace(ALL, **query)).ids  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("query", "found"),
    [
        ({}, ["d", "c", "b", "a"]),
        ({"search": "slipped øLST"}, ["c"]),
        ({"search": "old 10"}, ["b"]),
        ({"search": "old%"}, []),
        ({"search": "B old"}, ["b"]),
        ({"device": "barn", "verdicts": ("incomplete", "damaged")}, ["d", "b"]),
        ({"pinned": True}, ["c"]),
        ({"analysed": False}, ["d", "c", "a"]),
        ({"measured": True}, ["c", "b", "a"]),
        ({"calibrations": ("cal-2", "nothing")}, ["c"]),
        ({"labels": {"cow": ("9", "10")}}, ["b", "a"]),
        ({"labels": {"cow": ("9", "10"), "liner": ("new",)}}, []),
        ({"labels": {"cow": ("' OR 1 --",)}}, []),
        ({"since_utc": "2026-03-02", "until_utc": "2026-03-03"}, ["b"]),
        ({"order": Order.of("time")}, ["a", "b", "c", "d"]),
        ({"order": Order.of("length")}, ["a", "b", "c", "d"]),
        ({"order": Order.of("-length")}, ["c", "b", "a", "d"]),
        ({"order": Order.of("-losses")}, ["a", "c", "b", "d"]),
        ({"order": Order.of("label.cow")}, ["a", "b", "c", "d"]),
        ({"order": Order.of("-label.cow")}, ["c", "b", "a", "d"]),
        ({"order": Order.of("label.nobody")}, ["a", "b", "c", "d"]),
    ],
)
def test_what_matches_is_found_in_order(
    catalogue: CaptureCatalogue, query: dict[str, object], found: list[str]
) -> None:
    assert ids(catalogue, **query) == found


@pytest.mark.parametrize(
    "order", ["time", "-time", "length", "-length", "-losses", "label.cow", "-label.cow"]
)
def test_pages_follow_each_other_in_every_order(catalogue: CaptureCatalogue, order: str) -> None:
    query = replace(ALL, order=Order.of(order))
    whole, seen, after = catalogue.ask(query).ids, [], None
    for _ in whole:
        page = catalogue.ask(replace(query, limit=1, after=after))
        assert (page.total, page.in_all) == (4, 4)
        seen += page.ids
        after = page.after
    assert (seen, after) == (whole, None)


def test_a_page_goes_on_where_it_was_although_that_capture_is_gone(catalogue: CaptureCatalogue) -> None:
    page = catalogue.ask(replace(ALL, limit=2))
    catalogue.change(["c"], [])
    assert catalogue.ask(replace(ALL, limit=2, after=page.after)).ids == ["b", "a"]


def test_values_are_counted_with_all_filters_but_their_own(catalogue: CaptureCatalogue) -> None:
    query = replace(ALL, labels={"cow": ("9",), "liner": ("old",)}, measured=True)
    facets = catalogue.ask(query, days_in=OSLO).facets
    assert facets is not None
    assert facets.labels == {"cow": [Count("10", 1), Count("9", 1)], "liner": [Count("old", 1)]}
    assert facets.of["verdict"] == [Count("complete", 1)]
    assert facets.days == [Count("2026-03-01", 1)]
    verdicts = catalogue.ask(replace(ALL, verdicts=("damaged",)), days_in=OSLO).facets
    assert verdicts is not None
    assert {one.value: one.number for one in verdicts.of["verdict"]} == {
        "complete": 2,
        "incomplete": 1,
        "damaged": 1,
    }
    assert verdicts.of["calibration"] == []
    assert verdicts.labels == {}


def test_nothing_is_counted_that_nobody_asked_for(catalogue: CaptureCatalogue) -> None:
    assert catalogue.ask(ALL).facets is None


def test_days_begin_at_midnight_of_the_zone() -> None:
    catalogue = CaptureCatalogue()
    moments = ["2026-03-28T22:59:59.000Z", "2026-03-28T23:00:00.000Z", "2026-03-29T22:00:00.000Z"]
    catalogue.replace(row(str(i))._replace(created_utc=moment) for i, moment in enumerate(moments))
    oslo, india = (
        catalogue.ask(ALL, days_in=ZoneInfo(zone)).facets.days  # type: ignore[union-attr]
        for zone in ("Europe/Oslo", "Asia/Kolkata")
    )
    assert oslo == [Count("2026-03-30", 1), Count("2026-03-29", 1), Count("2026-03-28", 1)]
    assert india == [Count("2026-03-30", 1), Count("2026-03-29", 2)]


def test_captures_in_the_making_take_part_once_and_hide_what_is_known_of_them(
    catalogue: CaptureCatalogue,
) -> None:
    making = [row("e", 5, labels={"cow": "9"}), row("a", 1, labels={})]
    found = catalogue.ask(replace(ALL, labels={"cow": ("9",)}), making, OSLO)
    assert (found.ids, found.total, found.in_all) == (["e"], 1, 5)
    assert ids(catalogue, labels={"cow": ("9",)}) == ["a"]


def test_a_label_with_very_many_values_tells_the_most_frequent() -> None:
    catalogue = CaptureCatalogue()
    catalogue.replace(row(str(i), labels={"cow": str(i % 70)}) for i in range(80))
    facets = catalogue.ask(ALL, days_in=OSLO).facets
    assert facets is not None
    assert len(facets.labels["cow"]) == MOST_VALUES
    assert {one.number for one in facets.labels["cow"][:10]} == {2}


@pytest.mark.parametrize("text", ["", "cow", "label.", "-label.", "--time", "time desc"])
def test_an_order_that_there_is_none_of_is_refused(text: str) -> None:
    with pytest.raises(InputError) as refused:
        Order.of(text)
    assert "label.NAME" in refused.value.hint


def test_a_position_of_another_order_is_refused() -> None:
    with pytest.raises(InputError, match="another order"):
        Order.of("-length").position("2026-03-01T09:00:00.000Z", "a")
    assert Order.of("length").position("-1", "a") == Position(-1, "a")
