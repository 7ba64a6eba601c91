import pytest

from grabberd.reports.notation import COLOURS, as_text, colour, label, symbol, unknown_name, utc_time


def test_parameters_have_their_symbols():
    assert [symbol(name) for name in ("f_mm", "x0_px", "X0_mm", "b9", "b8=b9", "other")] == [
        "f",
        "x₀",
        "X₀",
        "b₉",
        "b₈ = b₉",
        "other",
    ]


def test_unknowns_are_named_with_their_view():
    assert unknown_name("left.b8=b9") == "left b₈ = b₉"
    assert unknown_name("lens.f_mm") == "lens f"


@pytest.mark.parametrize(
    ("key", "said"),
    [
        ("target_diameter_mm", "target diameter [mm]"),
        ("temperature_C", "temperature [°C]"),
        ("refractive_index", "refractive index"),
        ("mm", "mm"),
        ("frame", "calibration frame's targets"),
    ],
)
def test_a_key_is_said_in_words_with_its_unit(key, said):
    assert label(key) == said


@pytest.mark.parametrize(
    ("value", "said"),
    [
        (None, "–"),
        (True, "yes"),
        (-0.5, "−0.5"),
        (7, "7"),
        (["f_mm", 2], "f, 2"),
        ([], "none"),
        ({"a_mm": 1}, "a [mm] 1"),
    ],
)
def test_any_value_is_spelled_in_a_line(value, said):
    assert as_text(value) == said


def test_a_time_is_written_as_people_do_and_other_text_left_alone():
    assert utc_time("2026-01-02T03:04:05.678+00:00") == "2026-01-02 03:04:05 UTC"
    assert utc_time("2026-01-02T03:04:05+02:00") == "2026-01-02T03:04:05+02:00"


def test_views_have_colours_of_their_own():
    names = ["upper", "lower", "left"]
    assert len({colour(name, names) for name in names}) == 3
    assert colour("left") == COLOURS["left"]
