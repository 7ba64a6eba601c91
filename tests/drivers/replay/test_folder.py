"""What the names of pictures tell: a count, times, an order, or that they contradict one another."""

from collections.abc import Iterable
from pathlib import Path

import pytest

from grabberd.errors import DeviceRefused
from grabberd_replay.folder import Names

PERIOD_MS = 40
KEPT = (0, 1, 2, 4, 5)
"""Pictures of a camera's, the fourth of which is missing."""


def read(directory: Path, names: Iterable[str]) -> Names:
    for name in names:
        (directory / name).touch()
    return Names.of(directory)


def in_order(names: Names) -> list[str]:
    return [path.name for path in names.paths]


# --- a count ---


@pytest.mark.parametrize(
    "template", ["{:04d}.png", "frame-{}.png", "take2_{:03d}_of_9.png", "{}.TIFF", "frame{:04d}.png"]
)
def test_numbers_that_step_alike_are_a_count(tmp_path: Path, template: str) -> None:
    names = read(tmp_path, [template.format(n) for n in range(7, 19)])
    assert in_order(names) == [template.format(n) for n in range(7, 19)]
    assert (names.numbers, names.times_s, names.remarks) == (list(range(12)), None, ())


@pytest.mark.parametrize("step", [1, 2, 40])
def test_what_a_count_lacks_is_missing_and_named(tmp_path: Path, step: int) -> None:
    names = read(tmp_path, [f"{step * n:06d}.png" for n in (3, 4, 5, 7, 8, 11, 12, 13)])
    assert names.numbers == [0, 1, 2, 4, 5, 8, 9, 10]
    assert names.remarks == (
        f"By the count in its names 1 picture is missing after {5 * step:06d}.png, 2 pictures are missing "
        f"after {8 * step:06d}.png: their fields are lost.",
    )


def test_of_many_gaps_the_first_are_named_and_the_others_counted(tmp_path: Path) -> None:
    (remark,) = read(tmp_path, [f"{n}.png" for n in range(30) if n % 3 != 2]).remarks
    assert "missing after 7.png and 6 more: their fields are lost" in remark


@pytest.mark.parametrize("first", [0, 1])
def test_a_counter_goes_on_after_its_last_number(tmp_path: Path, first: int) -> None:
    names = read(tmp_path, [f"{n:04d}.png" for n in (9996, 9997, 9999, first, first + 1)])
    assert in_order(names)[0] == "9996.png"
    assert names.numbers == [0, 1, 3, 4, 5]
    assert names.remarks[0] == f"Its count goes on from 9999 with {first:04d}."


@pytest.mark.parametrize("last", [255, 65_535, 4_294_967_295])
def test_a_counter_of_bytes_goes_on_after_its_last_number(tmp_path: Path, last: int) -> None:
    names = read(tmp_path, [f"f{n}.png" for n in (last - 2, last - 1, last, 0, 2)])
    assert in_order(names)[0] == f"f{last - 2}.png"
    assert names.numbers == [0, 1, 2, 3, 5]


@pytest.mark.parametrize("template", ["{count:04d}_{saved:02d}.png", "{saved:02d}-of-5_{count}.png"])
def test_of_two_counts_that_of_the_camera_tells_what_is_missing(tmp_path: Path, template: str) -> None:
    names = read(tmp_path, [template.format(count=n, saved=k) for k, n in enumerate(KEPT)])
    assert names.numbers == list(KEPT)


def test_a_number_beside_a_count_that_tells_nothing_is_passed_over(tmp_path: Path) -> None:
    names = read(tmp_path, [f"{n:04d}_{20 + n + n * n % 7}C.png" for n in KEPT])
    assert names.numbers == list(KEPT)


def test_a_count_beside_the_time_of_day_tells_what_is_missing(tmp_path: Path) -> None:
    names = read(tmp_path, [f"20260301_10000{n // 3}_{n:04d}.png" for n in KEPT])
    assert names.numbers == list(KEPT)


def test_a_checksum_beside_a_count_is_no_time(tmp_path: Path) -> None:
    numbers = [n for n in range(40) if n not in (10, 11, 25)]
    names = read(tmp_path, [f"{n:04d}_{n * 7919 % 10007}.png" for n in numbers])
    assert names.numbers == numbers


@pytest.mark.parametrize("last", [9, 99, 120])
def test_a_count_that_need_not_have_begun_anew_has_not(tmp_path: Path, last: int) -> None:
    names = read(tmp_path, [f"{n}.png" for n in (0, 1, 2, last - 1, last)])
    assert names.numbers == [0, 1, 2, last - 1, last]


# --- times ---


@pytest.mark.parametrize(("unit", "per_ms"), [("ms", 1), ("us", 1_000), ("ns", 1_000_000)])
@pytest.mark.parametrize("jitter", [1, 2])
def test_numbers_that_step_unevenly_are_times_in_the_unit_of_a_camera_s_rate(
    tmp_path: Path, unit: str, per_ms: int, jitter: int
) -> None:
    stamps = [(12_000 + PERIOD_MS * n) * per_ms + (jitter if n == 2 else 0) for n in KEPT]
    names = read(tmp_path, [f"cam1_{stamp}.png" for stamp in stamps])
    assert names.times_s == pytest.approx([(one - stamps[0]) / per_ms / 1e3 for one in stamps])
    assert (names.numbers, names.remarks) == (None, (f"Its names are read as times in {unit}.",))


@pytest.mark.parametrize(("unit", "per_s"), [("s", 1), ("ms", 10**3), ("us", 10**6), ("ns", 10**9)])
def test_numbers_of_the_size_of_today_s_times_are_times_however_they_step(
    tmp_path: Path, unit: str, per_s: int
) -> None:
    period_s = 1 if unit == "s" else 0.04
    names = read(tmp_path, [f"{1_760_000_000 * per_s + round(n * period_s * per_s)}.png" for n in KEPT])
    assert names.times_s == pytest.approx([n * period_s for n in KEPT])
    assert names.remarks == (f"Its names are read as times in {unit}.",)


def test_two_pictures_that_were_written_at_once_leave_the_others_their_times(tmp_path: Path) -> None:
    stamps = [12_000_000 + 40_000 * n + (39_100 if n == 5 else 0) for n in range(20)]
    names = read(tmp_path, [f"{stamp}.png" for stamp in stamps])
    assert names.times_s == pytest.approx([(one - stamps[0]) / 1e6 for one in stamps])


def test_times_beside_a_count_of_what_was_saved_tell_what_is_missing(tmp_path: Path) -> None:
    stamps = [1_767_261_600_123 + PERIOD_MS * n + n % 2 for n in KEPT]
    names = read(tmp_path, [f"cam1_{k:04d}_{stamp}.png" for k, stamp in enumerate(stamps)])
    assert names.times_s == pytest.approx([(one - stamps[0]) / 1e3 for one in stamps])


@pytest.mark.parametrize("point", [".", ",", "-"])
def test_times_of_day_go_on_from_minute_to_minute(tmp_path: Path, point: str) -> None:
    names = read(tmp_path, [f"10-00-59{point}920.png", f"10-00-59{point}960.png", f"10-01-00{point}040.png"])
    assert names.times_s == pytest.approx([0.0, 0.04, 0.12])
    assert names.remarks == ("Its names are read as times of day.",)


@pytest.mark.parametrize("point", [".", ","])
def test_numbers_with_a_point_or_a_comma_are_times_in_seconds(tmp_path: Path, point: str) -> None:
    names = read(tmp_path, [f"t_{9.96 + 0.04 * n:.3f}.png".replace(".", point, 1) for n in KEPT])
    assert names.times_s == pytest.approx([0.04 * n for n in KEPT])
    assert names.remarks == ("Its names are read as times in seconds.",)


@pytest.mark.parametrize(
    "names",
    [
        ["20240229_235959.960.png", "20240301_000000.000.png", "20240301_000000.080.png"],
        ["2024-02-29T23-59-59-960.png", "2024-03-01T00-00-00-000.png", "2024-03-01T00-00-00-080.png"],
        ["a 2024.02.29 23h59m59_96.png", "a 2024.03.01 00h00m00_00.png", "a 2024.03.01 00h00m00_08.png"],
    ],
)
def test_dates_with_their_fractions_are_times(tmp_path: Path, names: list[str]) -> None:
    found = read(tmp_path, names)
    assert found.times_s == pytest.approx([0.0, 0.04, 0.12])
    assert found.remarks == ("Its names are read as dates.",)


@pytest.mark.parametrize("count", ["{}", "{:02d}", "{:04d}", "take{}"])
def test_a_count_after_the_date_of_the_first_picture_is_a_count(tmp_path: Path, count: str) -> None:
    names = read(tmp_path, [f"20240229_235959_{count.format(n)}.png" for n in range(1, 10)])
    assert (names.numbers, names.times_s) == (list(range(9)), None)


def test_a_count_that_begins_anew_with_every_second_is_no_fraction_of_it(tmp_path: Path) -> None:
    names = read(tmp_path, [f"20240229_23595{n // 25}_{n % 25:02d}.png" for n in range(60)])
    assert names.remarks == ("Its names tell an order, but neither a count nor times.",)
    assert names.numbers == list(range(60))


def test_a_date_that_no_calendar_has_is_none(tmp_path: Path) -> None:
    assert read(tmp_path, [f"20240230_235959.{n}00.png" for n in range(3)]).remarks != (
        "Its names are read as dates.",
    )


# --- an order, or nothing ---


def test_names_without_numbers_tell_an_order_and_that_is_said(tmp_path: Path) -> None:
    names = read(tmp_path, ["b.png", "a.png", "c10.png", "c9.png"])
    assert in_order(names) == ["a.png", "b.png", "c9.png", "c10.png"]
    assert names.numbers == [0, 1, 2, 3]
    assert names.remarks == ("Its names tell an order, but neither a count nor times.",)


def test_a_single_picture_needs_no_number(tmp_path: Path) -> None:
    names = read(tmp_path, ["still.png"])
    assert (names.numbers, names.times_s, names.remarks) == ([0], None, ())


@pytest.mark.parametrize(
    "numbers", [(1, 3, 8, 9, 15, 16, 22), (0, 1, 3, 7, 8, 13), (5, 6, 9, 11, 14, 18, 19)]
)
def test_small_numbers_that_step_unevenly_are_refused(tmp_path: Path, numbers: tuple[int, ...]) -> None:
    with pytest.raises(DeviceRefused, match=r"step by 1 to \d: neither a count nor times") as caught:
        read(tmp_path, [f"{n}.png" for n in numbers])
    assert "12.340.png in seconds" in caught.value.hint


def test_two_pictures_of_one_number_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(DeviceRefused, match=r"01\.png and 1\.png have the same number"):
        read(tmp_path, ["1.png", "01.png", "2.png"])


def test_pictures_of_several_kinds_are_refused_and_counted(tmp_path: Path) -> None:
    with pytest.raises(DeviceRefused, match=r"has 2 PNG and 1 TIFF pictures"):
        read(tmp_path, ["1.png", "2.png", "3.tif"])


def test_spellings_of_one_kind_are_one_kind(tmp_path: Path) -> None:
    assert read(tmp_path, ["1.jpg", "2.jpeg", "3.JPG"]).numbers == [0, 1, 2]


def test_hidden_files_of_other_computers_are_left_out_and_that_is_said(tmp_path: Path) -> None:
    names = read(tmp_path, ["._0001.png", "0001.png", "._0002.png", "0002.png"])
    assert in_order(names) == ["0001.png", "0002.png"]
    assert names.remarks == ("2 hidden files are left out.",)


def test_a_folder_without_pictures_is_refused_with_the_kinds_that_are_read(tmp_path: Path) -> None:
    with pytest.raises(DeviceRefused, match=r"has no pictures \(BMP, JPEG, PGM, PNG, TIFF\)"):
        read(tmp_path, ["clip.avi", "notes.txt", "._1.png"])


@pytest.mark.parametrize("odd", ["0007 copy.png", "background.png", "0007 (1).png"])
def test_a_name_unlike_all_others_is_refused_by_name(tmp_path: Path, odd: str) -> None:
    with pytest.raises(DeviceRefused, match="is named unlike the others, such as") as caught:
        read(tmp_path, [*(f"{n:04d}.png" for n in range(20)), odd])
    assert odd in caught.value.message


@pytest.mark.parametrize(
    "template", ["{:02d}-{:02d}-{:02d}.{:03d}", "{:02d}{:02d}{:02d}{:03d}", "cam_{:02d}{:02d}{:02d}.{:03d}"]
)
@pytest.mark.parametrize("first_s", [36_059, 86_399])
def test_times_of_day_go_on_over_the_minute_and_over_midnight(
    tmp_path: Path, template: str, first_s: int
) -> None:
    at_ms = [first_s * 1000 + 200 + PERIOD_MS * n for n in range(40) if n != 25]
    named = [
        template.format(t // 3_600_000 % 24, t // 60_000 % 60, t // 1000 % 60, t % 1000) + ".png"
        for t in at_ms
    ]
    names = read(tmp_path, named)
    assert in_order(names) == named
    assert names.times_s == pytest.approx([(t - at_ms[0]) / 1000 for t in at_ms])


def test_nine_digits_may_be_a_count_nevertheless(tmp_path: Path) -> None:
    assert read(tmp_path, [f"{n:09d}.png" for n in range(100_059_998, 100_060_004)]).numbers == [*range(6)]


def test_numbers_below_zero_come_first(tmp_path: Path) -> None:
    named = [f"{n}.png" for n in range(-3, 4)]
    names = read(tmp_path, named)
    assert (in_order(names), names.numbers) == (named, [*range(7)])


@pytest.mark.parametrize("start", ["img_", "frame", "", "cafe"])
def test_a_hexadecimal_count_is_one_and_said(tmp_path: Path, start: str) -> None:
    named = [f"{start}{n:04x}.png" for n in range(5, 40) if n != 17]
    names = read(tmp_path, named)
    assert (in_order(names), names.numbers) == (named, [n - 5 for n in range(5, 40) if n != 17])
    assert names.remarks[-1] == "Its names are read as a hexadecimal count."


def test_words_of_hexadecimal_letters_are_no_count(tmp_path: Path) -> None:
    assert (
        "neither a count nor times" in read(tmp_path, ["add.png", "bed.png", "cab.png", "fee.png"]).remarks[0]
    )


def test_capitals_make_no_difference(tmp_path: Path) -> None:
    assert in_order(read(tmp_path, ["F0001.png", "f0002.png", "F0003.png"])) == [
        "F0001.png",
        "f0002.png",
        "F0003.png",
    ]
