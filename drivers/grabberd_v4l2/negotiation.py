"""Negotiation of a stream: the input, then fields of a video standard or progressive pictures.

What is set is read back before the next is set. A camera without a video standard, such as a USB (UVC) one,
delivers progressive pictures.
"""

from collections.abc import Sequence

from grabberd.errors import DeviceRefused
from grabberd.instrument.acquisition.discovery import Verdict
from grabberd_v4l2 import abi, interlaced, progressive, standards
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.formats import FORMATS, bytes_per_pixel, needed_bytes
from grabberd_v4l2.layout import Granted
from grabberd_v4l2.node import Capability, Node
from grabberd_v4l2.options import V4l2Options
from grabberd_v4l2.profiles import Profile
from grabberd_v4l2.standards import DEFAULT

_LIST = "'grabberd devices' lists the available grabbers"
_OTHER_KINDS = {
    abi.CAP_META_CAPTURE: "metadata",
    abi.CAP_VBI_CAPTURE | abi.CAP_SLICED_VBI_CAPTURE: "teletext (VBI)",
    abi.CAP_RADIO: "radio",
    abi.CAP_VIDEO_OUTPUT | abi.CAP_VIDEO_OUTPUT_MPLANE: "output",
}


def capture_node(node: Node) -> Capability:
    """Capabilities of the node; raises if it cannot stream pictures.

    Raises:
        DeviceRefused: the node cannot stream pictures.
    """
    capability = node.capability()
    if not capability.flags & abi.CAP_VIDEO_CAPTURE:
        raise DeviceRefused(f"{node.path} ({capability.card}) {_what_else(capability.flags)}", _LIST)
    if not capability.flags & abi.CAP_STREAMING:
        raise DeviceRefused(
            f"{node.path} ({capability.card}) cannot stream into memory", "use another grabber; " + _LIST
        )
    return capability


def _what_else(flags: int) -> str:
    if flags & abi.CAP_VIDEO_CAPTURE_MPLANE:
        return "delivers pictures only in several planes, which grabberd does not read"
    kinds = [name for bits, name in _OTHER_KINDS.items() if flags & bits]
    return f"has no pictures: its node is for {', '.join(kinds) or 'something else'}"


def negotiate(node: Node, capability: Capability, options: V4l2Options, profile: Profile) -> Granted:
    """Sets input, standard and format, and reads them back; no buffers are allocated yet.

    Raises:
        DeviceRefused: the card is unsuitable, or grants no usable stream.
        OSError: a call failed.
    """
    if profile.verdict is Verdict.UNUSABLE:
        raise DeviceRefused(f"{node.path} ({capability.card}): {'; '.join(profile.remarks)}", profile.advice)
    _set_input(node, options)
    if _is_progressive(node, options, profile):
        (pix, scan), standard = progressive.set_up(node, options), ""
    else:
        pix, scan, standard = interlaced.set_up(node, options, profile)
    columns, fourcc = int(pix.width), abi.fourcc_name(pix.pixelformat)
    # A JPEG has lines only once it is decoded, and then without padding.
    bytes_per_line = 0 if FORMATS[fourcc].is_compressed else int(pix.bytesperline)
    return Granted(
        columns=columns,
        lines=int(pix.height),
        bytes_per_line=bytes_per_line or columns * bytes_per_pixel(fourcc),
        fourcc=fourcc,
        field=int(pix.field),
        standard=standard,
        kernel_driver=capability.driver,
        card=capability.card,
        bus_info=capability.bus_info,
        buffers=0,
        scan=scan,
    )


def _is_progressive(node: Node, options: V4l2Options, profile: Profile) -> bool:
    """True if whole pictures are to be requested: by the installer's word, or where there is no standard."""
    if options.arrangement is Arrangement.NONE:
        return not profile.none_is_woven
    return options.standard is None and options.arrangement is None and not node.standards()


def picture_bytes(granted: Granted) -> int:
    """Bytes of a whole picture in its buffer; 0 of a JPEG, whose pictures differ."""
    if FORMATS[granted.fourcc].is_compressed:
        return 0
    return needed_bytes(granted.fourcc, granted.lines, granted.columns, granted.bytes_per_line)


def _set_input(node: Node, options: V4l2Options) -> None:
    inputs = node.inputs()
    if not inputs and options.input is None and not node.standards():
        return  # a camera on a chip: drivers of some enumerate nothing
    if not inputs:
        raise DeviceRefused(f"{node.path} has no inputs, so it is no grabber", _LIST)
    wanted = _best(inputs, options) if options.input is None else _named(node, inputs, str(options.input))
    node.set_input(wanted.index)
    granted = node.input()
    if granted.index != wanted.index:
        raise DeviceRefused(
            f"{node.path} stays at input {_called(granted)} although {_called(wanted)} was requested",
            "choose another input, or none",
        )


def _best(inputs: Sequence[abi.Input], options: V4l2Options) -> abi.Input:
    """First input for a camera of this standard, or else the first that is no tuner."""
    for_cameras = [one for one in inputs if one.type != abi.INPUT_TYPE_TUNER]
    if options.arrangement is Arrangement.NONE:
        fitting = [one for one in for_cameras if not one.std]
    else:
        fitting = [one for one in for_cameras if one.std & standards.bits(options.standard or DEFAULT)]
    return (fitting or for_cameras or inputs)[0]


def _named(node: Node, inputs: Sequence[abi.Input], wanted: str) -> abi.Input:
    """Find an input by number or name; a unique prefix of a name is enough."""
    folded = wanted.casefold()
    exact = [one for one in inputs if folded in (str(one.index), _name(one).casefold())]
    begun = [one for one in inputs if _name(one).casefold().startswith(folded)]
    if exact or len(begun) == 1:
        return (exact or begun)[0]
    known = ", ".join(map(_called, inputs))
    raise DeviceRefused(f"{node.path} has no input '{wanted}'", f"option 'input': it has {known}")


def _called(one: abi.Input) -> str:
    return f"{one.index} ({_name(one)})"


def _name(one: abi.Input) -> str:
    return bytes(one.name).decode("utf-8", "replace")
