import copy
import re

import numpy as np
import pytest

from grabberd.bounded_documents import parse_yaml
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import InputError


def document(rows=2, columns=3):
    targets = [
        {"id": 10 * r + c, "x_mm": 6.5 * r, "y_mm": 6.5 * c, "z_mm": 1, "row": r, "column": c}
        for r in range(rows)
        for c in range(columns)
    ]
    return {"name": "plate", "target_diameter_mm": 1.5, "sigma_mm": 0.0, "targets": targets}


def test_a_file_becomes_arrays_sorted_by_target():
    shuffled = document()
    shuffled["targets"].reverse()
    model = ObjectModel.from_document(shuffled)
    assert model.target.tolist() == [0, 1, 2, 10, 11, 12]
    assert model.target.dtype == model.row.dtype == model.column.dtype == np.int32
    assert model.xyz_mm[4].tolist() == [6.5, 6.5, 1.0]
    assert (model.name, model.target_diameter_mm, model.sigma_mm, len(model)) == ("plate", 1.5, 0.0, 6)


def test_a_target_may_have_a_sigma_of_its_own():
    own = document()
    own["sigma_mm"] = 0.3
    assert ObjectModel.from_document(own).own_sigma_mm is None
    own["targets"][2]["sigma_mm"] = 0.05
    assert ObjectModel.from_document(own).target_sigma_mm.tolist() == [0.3, 0.3, 0.05, 0.3, 0.3, 0.3]
    own["targets"][2]["sigma_mm"] = -1
    with pytest.raises(InputError, match=r"targets\[2\].sigma_mm: is -1"):
        ObjectModel.from_document(own)


def test_neighbours_differ_by_one_row_or_one_column():
    model = ObjectModel.from_document(document())
    assert model.neighbours().tolist() == [[0, 1], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [4, 5]]


def test_a_hole_in_the_grid_has_no_neighbours():
    holed = document()
    del holed["targets"][1]
    assert ObjectModel.from_document(holed).neighbours().tolist() == [[0, 2], [1, 4], [2, 3], [3, 4]]


def test_a_single_target_has_no_neighbours():
    assert ObjectModel.from_document(document(1, 1)).neighbours().shape == (0, 2)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda d: d.pop("name"), "name: is missing"),
        (lambda d: d.update(shape="flat"), "shape: unknown key"),
        (lambda d: d.update(target_diameter_mm=0), "target_diameter_mm: is 0, expected a number above 0"),
        (lambda d: d.update(sigma_mm=-0.1), "sigma_mm: is -0.1, expected a number from 0"),
        (lambda d: d.update(targets=[]), r"targets: is \[\], expected a list of targets"),
        (lambda d: d.update(targets="many"), "targets: is 'many'"),
        (lambda d: d["targets"].append(7), r"targets\[6\]: is 7, expected a mapping"),
        (lambda d: d["targets"][2].pop("z_mm"), r"targets\[2\]\.z_mm: is missing"),
        (lambda d: d["targets"][2].update(x=1), r"targets\[2\]\.x: unknown key"),
        (lambda d: d["targets"][2].update(x_mm=float("inf")), r"targets\[2\]\.x_mm: is inf"),
        (
            lambda d: d["targets"][2].update(row=1 << 31),
            r"targets\[2\]\.row: is 2147483648, expected a whole",
        ),
        (lambda d: d["targets"][2].update(id=1.5), r"targets\[2\]\.id: is 1\.5, expected a whole number"),
        (lambda d: d["targets"][2].update(id=10), r"targets\[3\]\.id: 10 is given twice"),
        (
            lambda d: d["targets"][5].update(row=0, column=1),
            r"targets\[5\]\.row, column: 0, 1 is given twice",
        ),
    ],
)
def test_a_wrong_value_is_named_with_its_key(change, said):
    wrong = copy.deepcopy(document())
    change(wrong)
    with pytest.raises(InputError, match=said):
        ObjectModel.from_document(wrong)


def test_all_problems_are_named_at_once():
    wrong = document()
    wrong["targets"][0]["row"] = "first"
    del wrong["name"], wrong["targets"][1]["y_mm"]
    with pytest.raises(InputError, match=r"name.*targets\[0\]\.row.*targets\[1\]\.y_mm") as caught:
        ObjectModel.from_document(wrong)
    assert caught.value.hint


def test_targets_are_the_same_points_in_every_field_unless_the_file_says_otherwise():
    assert ObjectModel.from_document(document()).homologous
    assert not ObjectModel.from_document(document() | {"homologous": False}).homologous
    with pytest.raises(InputError, match="homologous: is 'no', expected true or false"):
        ObjectModel.from_document(document() | {"homologous": "no"})


def refusal(change_all):
    """What is said of a file of 108 targets, in each of which the same is changed."""
    wrong = document(12, 9)
    for target in wrong["targets"]:
        change_all(target)
    with pytest.raises(InputError) as caught:
        ObjectModel.from_document(wrong)
    return caught.value.message


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.pop("x_mm"), "targets[0].x_mm: is missing, expected a finite number (so in all 108"),
        (
            lambda t: t.update(x_mm="1.0"),
            "targets[0].x_mm: is '1.0', expected a finite number (so in all 108",
        ),
        (
            lambda t: t.update(x_mm=f"{t['id']},0"),
            "targets[0].x_mm: is '0,0', expected a finite number (so in",
        ),
        (
            lambda t: t.update(x_mm=float("nan")),
            "targets[0].x_mm: is nan, expected a finite number (so in all",
        ),
        (lambda t: t.update(depth=t["id"]), "targets[0].depth: unknown key; known keys are id, x_mm, "),
        (
            lambda t: t.update(sigma_mm=-t["id"] - 1),
            "targets[0].sigma_mm: is -1.0, expected a number from 0 (so",
        ),
        (
            lambda t: t.update(row=0.5),
            "targets[0].row: is 0.5, expected a whole number (so in all 108 targets",
        ),
    ],
)
def test_a_problem_of_every_target_is_told_once(change, said):
    message = refusal(change)
    assert said in message
    assert message.count("targets[") == 1
    assert "all 108 targets: ids 0, 1, 2, 3, 4, …" in message


def test_each_of_several_problems_of_every_target_is_told_once():
    message = refusal(lambda target: [target.pop(key) for key in ("x_mm", "y_mm", "id")])
    assert message.count("is missing") == 3
    assert "all 108 targets: targets[0], targets[1], targets[2], targets[3], targets[4], …" in message


def test_a_problem_of_some_targets_names_them():
    wrong = document(12, 9)
    for index in (3, 50, 70):
        del wrong["targets"][index]["z_mm"]
    with pytest.raises(
        InputError, match=r"targets\[3\]\.z_mm: is missing.*in 3 of 108 targets: ids 3, 55, 77\)"
    ):
        ObjectModel.from_document(wrong)


def test_ids_that_are_given_twice_are_told_once():
    assert "targets[1].id: 5 is given twice (so in 107 of 108 targets" in refusal(lambda t: t.update(id=5))


def test_entries_that_are_no_mappings_are_told_once():
    message = (
        "targets[0]: is 0, expected a mapping of id, x_mm, y_mm, z_mm, row, column (so in all 108 targets"
    )
    with pytest.raises(InputError) as caught:
        ObjectModel.from_document(document() | {"targets": [*range(108)]})
    assert message in caught.value.message


def test_a_file_of_nothing_but_problems_tells_the_first_ones():
    wrong = document(12, 9)
    for target in wrong["targets"]:
        target[f"x{target['id']}"] = 1
    with pytest.raises(InputError, match=r"targets\[0\]\.x0: unknown.*; and 88 more") as caught:
        ObjectModel.from_document(wrong)
    assert caught.value.message.count("unknown key") == 20


def test_the_kind_of_file_is_named():
    with pytest.raises(InputError, match="the calibration frame's file cannot be used"):
        ObjectModel.from_document({}, "the calibration frame's file")


def test_a_word_of_yaml_1_1_is_shown_with_its_place_and_what_to_write():
    with pytest.raises(InputError) as caught:
        ObjectModel.from_document(parse_yaml("homologous: yes\nsigma_mm: 1_0\n"))
    for key, line, advice in (
        ("homologous", 1, "truth value write true"),
        ("sigma_mm", 2, "number write 10"),
    ):
        told = rf"{key}: is '\w+' \(line {line}, column \d+: a text in YAML 1.2; for a {advice}\), expected"
        assert re.search(told, caught.value.message)
