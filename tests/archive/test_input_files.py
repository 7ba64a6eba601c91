"""CSV files with the true positions of targets; identifications are read in tests of `calibrate`."""

import pytest

from grabberd.archive.input_files import read_identifications, read_truth
from grabberd.core.calibration.identification.manual_identification import Mark
from grabberd.errors import InputError


@pytest.fixture
def file(tmp_path):
    def write(text):
        path = tmp_path / "truth.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_row_holds_for_every_field_where_there_is_no_n(file):
    truth = read_truth(file("target,x_mm,y_mm,z_mm\n3,1.5,-2,0.25\n"))
    assert truth.n is None
    assert truth.target.tolist() == [3]
    assert truth.xyz_mm.tolist() == [[1.5, -2.0, 0.25]]
    assert truth.expected.all()


def test_with_n_a_row_holds_for_its_field(file):
    truth = read_truth(file("n,target,x_mm,y_mm,z_mm,visible\n0,3,1,2,3,1\n1,3,1,2,3,0\n"))
    assert truth.n.tolist() == [0, 1]
    assert truth.expected.tolist() == [True, False]


def test_a_spreadsheets_byte_order_mark_does_no_harm(file):
    assert read_truth(file("\ufefftarget,x_mm,y_mm,z_mm\n3,1,2,3\n")).target.tolist() == [3]


def test_a_target_keeps_the_zeros_that_are_printed_beside_it(file):
    assert read_truth(file("target,x_mm,y_mm,z_mm\n011,1.5,2,3\n012,2.5,2,3\n")).target.tolist() == [11, 12]


TRUTH = {
    "R, write.csv2": '"";"target";"x_mm";"y_mm";"z_mm"\n"1";1;10,25;20,5;3,75\n"2";2;11;20,5;3,75\n',
    "R, write.table": '"target" "x_mm" "y_mm" "z_mm"\n"1" 1 10.25 20.5 3.75\n"2" 2 11 20.5 3.75\n',
    "pandas": ",target,x [mm],y [mm],z [mm]\n0,1,10.25,20.5,3.75\n1,2,11.0,20.5,3.75\n",
    "Excel": "\ufefftarget;X (mm);Y (mm);Z (mm);;\r\n1;10,25;20,5;3,75;;\r\n2;11;20,5;3,75;;\r\n;;;;;\r\n",
    "with units": "Rig 3\n\ntarget\tx\ty\tz\n\tmm\tmm\tmm\n1\t10.25\t20.5\t3.75\n2\t11\t20.5\t3.75\n",
    "fixed decimals": "target;x_mm;y_mm;z_mm\n1;10,250;20,500;3,750\n2;11,000;20,500;3,750\n",
}


@pytest.mark.parametrize("program", TRUTH)
def test_positions_are_read_as_programs_write_them(file, program):
    truth = read_truth(file(TRUTH[program]))
    assert truth.target.tolist() == [1, 2]
    assert truth.xyz_mm.tolist() == [[10.25, 20.5, 3.75], [11.0, 20.5, 3.75]]


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_identifications_are_read_as_programs_write_them(tmp_path, encoding):
    path = tmp_path / "marks.csv"
    path.write_text('"view"\t"target"\t"x_px"\t"y_px"\n"left"\t17\t123,5\t240,25\n', encoding=encoding)
    assert read_identifications(path) == [Mark("left", 17, 123.5, 240.25)]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "target;x_mm;y_mm;z_mm\n1;10;20;30;5\n",
            "line 2 has 5 cells, the header 4: which of them has no name",
        ),
        (
            "target;x_mm;y_mm;z_mm\n1;1,250;20;30\n",
            "'1,250', which may be a decimal number or over a thousand",
        ),
        ("target;x [cm];y [cm];z [cm]\n1;1;2;3\n", "no column x_mm, y_mm, z_mm: line 1 names target, x_cm"),
        ("target;x_mm;y_mm;z_mm\n;cm;cm;cm\n1;1;2;3\n", "the column x_mm is in mm, by the line below in cm"),
        ("target,x_mm,y_mm\n1,2,3\n", "has no column z_mm"),
        ("", "has no column target, x_mm, y_mm, z_mm: it is empty"),
        ("target,x_mm,y_mm,z_mm\n", "has no rows"),
        ("target,x_mm,y_mm,z_mm\n1,2,3,4\n1,2,three,4\n", "line 3: .*three"),
        ("target,x_mm,y_mm,z_mm\n1,2\n", "line 2 has 2 cells, the header 4"),
        (
            "target,x_mm,y_mm,z_mm\n1,10,25,20,5,3,75\n",
            "line 2 has 7 cells, the header 4: decimal commas between commas",
        ),
        ("target,x_mm,y_mm,z_mm\n1,2,nan,4\n", "line 2: y_mm is 'nan', not a number"),
        ("target,x_mm,y_mm,z_mm\n6.5,1,2,3\n", "line 2: target 6.5 is not a whole number"),
        ("target,x_mm,y_mm,z_mm\n2147483648,1,2,3\n", "line 2: target 2.14748e\\+09 is not a whole number"),
        ("target,x_mm,y_mm,z_mm,visible\n1,2,3,4,2\n", "line 2: visible 2 is neither 1 nor 0"),
        ("target,x_mm,y_mm,z_mm,x_mm\n1,2,3,4,5\n", "both columns x_mm and x_mm"),
        ("target,x_mm,y_mm,z_mm\n1,2,3,4\n1,5,6,7\n", "2 rows of target 1"),
        ("n,target,x_mm,y_mm,z_mm\n4,1,2,3,4\n4,1,2,3,4\n", "target 1 in field 4"),
    ],
)
def test_what_is_wrong_is_named(file, text, message):
    with pytest.raises(InputError, match=message):
        read_truth(file(text))


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.csv cannot be read: No such file or directory\n"):
        read_truth(tmp_path / "gone.csv")


@pytest.mark.parametrize("row", ["left,1,nan,2", "left,1,2,inf", "left,4294967296,1,2"])
def test_a_mark_that_is_nowhere_is_refused_by_its_line(file, row):
    with pytest.raises(InputError, match=r"truth\.csv.*line 2: "):
        read_identifications(file(f"view,target,x_px,y_px\n{row}\n"))
