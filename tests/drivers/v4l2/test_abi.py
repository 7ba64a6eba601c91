"""The kernel's structures are laid out as C lays them out, on this machine and on those of 32 bits."""

import ctypes
import runpy
import shutil
import subprocess

import pytest
import videodev2

from grabberd_v4l2 import abi
from grabberd_v4l2.formats import FORMATS

STRUCTURES = {
    "v4l2_capability": abi.Capability,
    "v4l2_input": abi.Input,
    "v4l2_standard": abi.Standard,
    "v4l2_fmtdesc": abi.FmtDesc,
    "v4l2_pix_format": abi.PixFormat,
    "v4l2_format": abi.Format,
    "v4l2_requestbuffers": abi.RequestBuffers,
    "v4l2_timecode": abi.Timecode,
    "v4l2_buffer": abi.Buffer,
    "v4l2_event": abi.Event,
    "v4l2_event_subscription": abi.EventSubscription,
    "v4l2_frmsize_discrete": abi.DiscreteSize,
    "v4l2_frmsize_stepwise": abi.SizeRange,
    "v4l2_frmival_stepwise": abi.IntervalRange,
    "v4l2_captureparm": abi.CaptureParm,
    "v4l2_streamparm": abi.StreamParm,
}
OF_THE_HEADER_ALONE = {"v4l2_frmsizeenum": abi.FrmSizeEnum, "v4l2_frmivalenum": abi.FrmIvalEnum}
"""Structures that the other package lacks."""
CONSTANTS = (
    {"V4L2_BUF_TYPE_VIDEO_CAPTURE": abi.CAPTURE, "V4L2_MEMORY_MMAP": abi.MEMORY_MMAP}
    | {f"V4L2_FIELD_{arrangement.name}": arrangement.value for arrangement in abi.Arrangement}
    | {
        f"V4L2_{name}": value
        for name, value in vars(abi).items()
        if name.startswith(
            ("CAP_", "BUF_FLAG_", "INPUT_TYPE_", "IN_ST_", "STD_", "EVENT_", "FRMSIZE_", "FRMIVAL_")
        )
    }
)
ON_THIS_MACHINE = ()
ON_32_BITS = ("-m32", "-malign-double", "-D_TIME_BITS=64", "-D_FILE_OFFSET_BITS=64")
"""As on 32-bit ARM, whose C aligns 64-bit numbers to 8 bytes as ctypes does here."""
COMPILER = shutil.which("gcc") or shutil.which("cc")


def assertions(module):
    """C that compiles only if every size, place and number of a module is right."""
    yield "#include <stddef.h>"
    yield "#include <linux/videodev2.h>"
    for name, structure in (STRUCTURES | OF_THE_HEADER_ALONE).items():
        laid = module[structure.__name__]
        yield f'_Static_assert(sizeof(struct {name}) == {ctypes.sizeof(laid)}, "size of {name}");'
        for field in names_in_c(laid):
            place = getattr(laid, field).offset
            yield f'_Static_assert(offsetof(struct {name}, {field}) == {place}, "{name}.{field}");'
    yield f'_Static_assert(sizeof(v4l2_std_id) == {ctypes.sizeof(abi.StandardSet)}, "v4l2_std_id");'


def names_in_c(structure):
    """Fields by their names; those of a union without a name stand for it."""
    for name, kind, *_ in structure._fields_:
        nameless = name in getattr(structure, "_anonymous_", ())
        yield from (inner for inner, *_ in kind._fields_) if nameless else (name,)


def numbers():
    for name, value in CONSTANTS.items():
        yield f'_Static_assert((unsigned long long)({name}) == {value}ULL, "{name}");'
    for number, name in abi.NAMES.items():
        yield f'_Static_assert(VIDIOC_{name} == {number}U, "VIDIOC_{name}");'


def compiled(folder, lines, options):
    """What the compiler has to complain of; skips where it cannot compile for that machine at all."""
    if COMPILER is None:
        pytest.skip("there is no C compiler")
    (folder / "gnu").mkdir()
    (folder / "gnu" / "stubs-32.h").touch()  # wanted by headers that are otherwise the same for both
    command = [COMPILER, "-fsyntax-only", "-x", "c", f"-I{folder}", *options, "-"]
    if options is ON_32_BITS:
        command.append("-I/usr/include/x86_64-linux-gnu")  # where Debian has them
    header_alone = complaints(command, "#include <linux/videodev2.h>")
    if header_alone:
        pytest.skip(f"the compiler cannot: {header_alone.splitlines()[0]}")
    return complaints(command, "\n".join(lines))


def complaints(command, source):
    return subprocess.run(command, input=source, capture_output=True, text=True, check=False).stderr


def test_structures_and_numbers_are_those_of_the_kernels_header(tmp_path):
    lines = [*assertions(vars(abi)), *numbers()]
    assert compiled(tmp_path, lines, ON_THIS_MACHINE) == ""


def test_structures_are_those_of_a_32_bit_machine_when_they_are_defined_on_one(tmp_path, monkeypatch):
    monkeypatch.setattr(ctypes, "c_size_t", ctypes.c_uint32)
    as_on_32_bits = runpy.run_path(abi.__file__)
    assert ctypes.sizeof(as_on_32_bits["Format"]) == 204
    assert compiled(tmp_path, assertions(as_on_32_bits), ON_32_BITS) == ""


@pytest.mark.parametrize("options", [ON_THIS_MACHINE, ON_32_BITS])
def test_the_comparison_with_the_header_can_fail(tmp_path, options):
    wrong = vars(abi) | {"Buffer": abi.Format}
    assert "size of v4l2_buffer" in compiled(tmp_path, assertions(wrong), options)


# videodev2 is Raspberry Pi's, generated from the header: it stands in for it where there is no C compiler.
@pytest.mark.parametrize("name", STRUCTURES)
def test_sizes_and_places_are_those_of_another_package(name):
    ours, theirs = STRUCTURES[name], getattr(videodev2, name)
    assert ctypes.sizeof(ours) == ctypes.sizeof(theirs)
    assert places(ours, ours) == places(theirs, ours)


def places(structure, named_like):
    """Offset and size of the fields that `named_like` has."""
    fields = {name: getattr(structure, name) for name, *_ in named_like._fields_}
    return {name: (field.offset, field.size) for name, field in fields.items()}


def test_constants_are_those_of_another_package():
    theirs = {name: value_of(getattr(videodev2, name)) for name in CONSTANTS}
    assert theirs == CONSTANTS


def value_of(constant):
    """Its enumerations consist of ctypes objects."""
    return getattr(constant, "value", constant)


LACKING = ["G_STD", "S_STD", "QUERYSTD", "ENUM_FRAMESIZES", "ENUM_FRAMEINTERVALS"]


def test_call_numbers_are_those_of_another_package():
    theirs = {name: getattr(videodev2, f"VIDIOC_{name}", None) for name in abi.NAMES.values()}
    assert [name for name, number in theirs.items() if number is None] == LACKING
    for number, name in abi.NAMES.items():
        assert theirs[name] is None or number == theirs[name] % 2**32


@pytest.mark.skipif(ctypes.sizeof(ctypes.c_void_p) != 8, reason="written down for 64 bits")
def test_call_numbers_are_those_written_down():
    assert abi.DQBUF == 0xC0585611
    assert abi.S_FMT == 0xC0D05605
    assert abi.S_STD == 0x40085618
    assert abi.QUERYSTD == 0x8008563F
    assert abi.ENUMINPUT == 0xC050561A
    assert abi.DQEVENT == 0x80885659
    assert abi.ENUM_FRAMESIZES == 0xC02C564A
    assert abi.ENUM_FRAMEINTERVALS == 0xC034564B
    assert abi.S_PARM == 0xC0CC5616


def test_pixel_formats_have_numbers_and_names():
    kernels = {"MJPG": "MJPEG"}
    for name in FORMATS:
        assert abi.fourcc(name) == getattr(videodev2, f"V4L2_PIX_FMT_{kernels.get(name, name)}")
        assert abi.fourcc_name(abi.fourcc(name)) == name
    assert abi.fourcc_name(abi.fourcc("Y8  ")) == "Y8  "
