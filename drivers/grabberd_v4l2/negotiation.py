"""Negotiation of a stream: input, standard, format and field order, each read back after it is set."""

import errno
from collections.abc import Sequence
from itertools import product

from grabberd.acquisition.discovery import Verdict
from grabberd.errors import DeviceRefused
from grabberd_v4l2 import abi, standards
from grabberd_v4l2.abi import ONE_FIELD, Arrangement
from grabberd_v4l2.formats import FORMATS, bytes_per_pixel, needed_bytes
from grabberd_v4l2.layout import Granted
from grabberd_v4l2.node import Capability, Node
from grabberd_v4l2.options import V4l2Options
from grabberd_v4l2.profiles import Profile

COLUMNS = 720
# Only lines have to be whole: cards that sample square pixels (768 columns) or fewer ones are usable.
FEWEST_COLUMNS, MOST_COLUMNS = 640, 1024
FRAME_LINES = 576
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
        return "delivers pictures only in several planes, as no analog grabber does"
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
    standard = _set_standard(node, options)
    pix = _set_format(node, options, profile)
    columns, fourcc = int(pix.width), abi.fourcc_name(pix.pixelformat)
    return Granted(
        columns=columns,
        lines=int(pix.height),
        bytes_per_line=int(pix.bytesperline) or columns * bytes_per_pixel(fourcc),
        fourcc=fourcc,
        field=int(pix.field),
        standard=standards.name(standard),
        kernel_driver=capability.driver,
        card=capability.card,
        bus_info=capability.bus_info,
        buffers=0,
    )


def picture_bytes(granted: Granted) -> int:
    """Bytes of a whole picture in its buffer."""
    return needed_bytes(granted.fourcc, granted.lines, granted.columns, granted.bytes_per_line)


def _set_input(node: Node, options: V4l2Options) -> None:
    inputs = node.inputs()
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
    analog = [one for one in for_cameras if one.std & standards.bits(options.standard)]
    return (analog or for_cameras or inputs)[0]


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


def _set_standard(node: Node, options: V4l2Options) -> int:
    wanted = standards.bits(options.standard)
    offered = node.standards()
    if not any(one.id & wanted for one in offered):
        names = ", ".join(one.name.decode("ascii", "replace") for one in offered) or "none at all"
        raise DeviceRefused(
            f"{node.path} has no {options.standard} at this input; its standards: {names}",
            "choose a composite or S-Video input (option 'input') or another grabber",
        )
    # Always, whatever it is at now: stk1160 and usbtv start up in NTSC.
    node.set_standard(wanted)
    granted = node.standard()
    if not standards.is_50_hz(granted):
        raise DeviceRefused(
            f"{node.path} was set to {options.standard} but is at {standards.name(granted)}",
            "the card does not run at 50 Hz; use another grabber",
        )
    return granted


def _set_format(node: Node, options: V4l2Options, profile: Profile) -> abi.PixFormat:
    """First request that is granted exactly, or else the first usable answer."""
    # Never FIELD_ANY: with it several drivers silently deliver one field at half height.
    formats = _common_formats(node, options.format)
    orders = profile.field_orders if options.arrangement is None else (options.arrangement,)
    answers = []
    for order, fourcc in product(orders, formats):
        answer = _granted(node, _lines(order), fourcc, order)
        if answer is not None and _is_our_size(answer) and _format_of(answer) == (fourcc, order):
            return answer
        answers.append(answer)
    # Later requests have changed the card's state: a usable answer has to be requested once more.
    if options.arrangement is None:
        for answer in filter(None, answers):
            if _is_of_use(answer, options, profile) and _is_granted_again(node, answer):
                return answer
    raise _nothing_granted(node, orders, formats, [answer for answer in answers if answer is not None])


def _common_formats(node: Node, wanted: Sequence[str]) -> Sequence[str]:
    offered = node.pixel_formats()
    common = [fourcc for fourcc in wanted if fourcc in offered]
    if not common:
        raise DeviceRefused(
            f"{node.path} delivers {', '.join(offered) or 'no format at all'}, none of {', '.join(wanted)}",
            f"option 'format' allows {', '.join(FORMATS)}; a card with none of them cannot be used",
        )
    return common


def _granted(node: Node, lines: int, fourcc: str, order: int) -> abi.PixFormat | None:
    """Format that the card offers for a requested one; None if it refuses."""
    try:
        node.set_format(COLUMNS, lines, fourcc, order)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        return None
    return node.format()


def _is_granted_again(node: Node, answer: abi.PixFormat) -> bool:
    again = _granted(node, answer.height, *_format_of(answer))
    return again is not None and _format_of(again) == _format_of(answer) and _is_our_size(again)


def _is_of_use(answer: abi.PixFormat, options: V4l2Options, profile: Profile) -> bool:
    fourcc, order = _format_of(answer)
    fields = [a for a in Arrangement if a is not Arrangement.ANY]
    if not profile.none_is_woven:
        fields.remove(Arrangement.NONE)
    return fourcc in options.format and order in fields and _is_our_size(answer)


def _format_of(answer: abi.PixFormat) -> tuple[str, int]:
    return abi.fourcc_name(answer.pixelformat), int(answer.field)


def _lines(order: int) -> int:
    return FRAME_LINES // 2 if order in ONE_FIELD else FRAME_LINES


def _is_our_size(answer: abi.PixFormat) -> bool:
    return bool(answer.height == _lines(answer.field)) and FEWEST_COLUMNS <= answer.width <= MOST_COLUMNS


def _nothing_granted(
    node: Node, orders: Sequence[int], formats: Sequence[str], answers: Sequence[abi.PixFormat]
) -> DeviceRefused:
    requested = ", ".join(_order_name(order) for order in orders)
    got = "; ".join(dict.fromkeys(map(_in_words, answers))) or "none of them"
    return DeviceRefused(
        f"{node.path}: requested {COLUMNS}×{FRAME_LINES} (a field: {FRAME_LINES // 2}) in field order "
        f"{requested}, format {', '.join(formats)}; it grants {got}",
        "remove the options 'field_order' and 'format'; if that does not help, this card cannot deliver "
        "whole PAL fields",
    )


def _in_words(answer: abi.PixFormat) -> str:
    fourcc, order = _format_of(answer)
    return f"{answer.width}×{answer.height} {fourcc} {_order_name(order)}"


def _order_name(order: int) -> str:
    return Arrangement(order).name if order in list(Arrangement) else f"field {order}"
