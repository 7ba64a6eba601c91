"""Negotiation of a stream: the input, then fields of a video standard or progressive pictures.

Each setting is read back before the next one is made: standard, pixel format and field order of an interlaced
stream; size, pixel format and rate of a progressive one. A camera without a video standard, such as a USB
(UVC) camera, delivers progressive pictures.
"""

import errno
from collections.abc import Collection, Iterable, Sequence
from fractions import Fraction
from itertools import product
from typing import NamedTuple

from grabberd.errors import DeviceRefused
from grabberd.instrument.acquisition.device import Verdict
from grabberd_v4l2 import abi, formats
from grabberd_v4l2.abi import ONE_FIELD, Arrangement
from grabberd_v4l2.fields import Granted
from grabberd_v4l2.formats import (
    DEFAULT,
    FORMATS,
    LEAST_HZ,
    RAW,
    SCAN_525,
    SCAN_625,
    Mode,
    Scan,
    Wish,
    bytes_per_pixel,
    in_words,
    is_near,
    needed_bytes,
    offered,
    wishes,
)
from grabberd_v4l2.node import Capability, Node
from grabberd_v4l2.options import V4l2Options
from grabberd_v4l2.profiles import Profile

_LIST = "'grabberd devices' lists the available grabbers"
_OTHER_KINDS = {
    abi.CAP_META_CAPTURE: "metadata",
    abi.CAP_VBI_CAPTURE | abi.CAP_SLICED_VBI_CAPTURE: "teletext (VBI)",
    abi.CAP_RADIO: "radio",
    abi.CAP_VIDEO_OUTPUT | abi.CAP_VIDEO_OUTPUT_MPLANE: "output",
}


def capture_node(node: Node) -> Capability:
    """Capabilities of a node that can stream pictures.

    Raises:
        DeviceRefused: The node cannot stream pictures.
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
        DeviceRefused: The card is unsuitable, or grants no usable stream.
        OSError: A call failed.
    """
    if profile.verdict is Verdict.UNUSABLE:
        raise DeviceRefused(f"{node.path} ({capability.card}): {'; '.join(profile.remarks)}", profile.advice)
    _set_input(node, options)
    if _is_progressive(node, options, profile):
        (pix, scan), standard = _set_up_progressive(node, options), ""
    else:
        pix, scan, standard = _set_up_interlaced(node, options, profile)
    columns, fourcc = int(pix.width), abi.fourcc_name(pix.pixelformat)
    # A JPEG has lines only after decoding, and then without padding.
    bytes_per_line = 0 if FORMATS[fourcc].is_compressed else int(pix.bytesperline)
    return Granted(
        columns=columns,
        lines=int(pix.height),
        bytes_per_line=bytes_per_line or columns * bytes_per_pixel(fourcc),
        fourcc=fourcc,
        field=int(pix.field),
        standard=standard,
        node=capability,
        buffers=0,
        scan=scan,
    )


def _is_progressive(node: Node, options: V4l2Options, profile: Profile) -> bool:
    """True for progressive pictures: if the installer requests them, or if there is no standard."""
    if options.arrangement is Arrangement.NONE:
        return not profile.none_is_woven
    return options.standard is None and options.arrangement is None and not node.standards()


def picture_bytes(granted: Granted) -> int:
    """Bytes of a complete picture in its buffer; 0 for JPEG, whose size varies."""
    if FORMATS[granted.fourcc].is_compressed:
        return 0
    return needed_bytes(granted.fourcc, granted.lines, granted.columns, granted.bytes_per_line)


def _set_input(node: Node, options: V4l2Options) -> None:
    inputs = node.inputs()
    if not inputs and options.input is None and not node.standards():
        return  # drivers of some camera chips enumerate no inputs
    if not inputs:
        raise DeviceRefused(f"{node.path} has no inputs, so it is not a grabber", _LIST)
    wanted = _best(inputs, options) if options.input is None else _named(node, inputs, str(options.input))
    node.set_input(wanted.index)
    granted = node.input()
    if granted.index != wanted.index:
        raise DeviceRefused(
            f"{node.path} stays at input {_called(granted)} although {_called(wanted)} was requested",
            "choose another input, or none",
        )


def _best(inputs: Sequence[abi.Input], options: V4l2Options) -> abi.Input:
    """The first input for a camera of this standard, or else the first that is not a tuner."""
    for_cameras = [one for one in inputs if one.type != abi.INPUT_TYPE_TUNER]
    if options.arrangement is Arrangement.NONE:
        fitting = [one for one in for_cameras if not one.std]
    else:
        fitting = [one for one in for_cameras if one.std & formats.bits(options.standard or DEFAULT)]
    return (fitting or for_cameras or inputs)[0]


def _named(node: Node, inputs: Sequence[abi.Input], wanted: str) -> abi.Input:
    """Finds an input by number, name or unique prefix of a name."""
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


COLUMNS = 720
# All lines are required, but not all columns: cards with square pixels (768 columns) or fewer are usable.
FEWEST_COLUMNS, MOST_COLUMNS = 640, 1024


def _set_up_interlaced(node: Node, options: V4l2Options, profile: Profile) -> tuple[abi.PixFormat, Scan, str]:
    """Sets standard and format.

    Returns:
        The granted format, the scan of the granted standard, and the standard's name.

    Raises:
        DeviceRefused: The card does not support the standard, or grants no usable stream.
        OSError: A call failed.
    """
    standard, scan = _set_standard(node, options)
    return _set_format(node, _Wanted.of(node, options, profile, scan)), scan, standard


def _set_standard(node: Node, options: V4l2Options) -> tuple[str, Scan]:
    """Sets the standard; returns its name and scan."""
    name = options.standard or DEFAULT
    wanted, offered = formats.bits(name), node.standards()
    if not any(one.id & wanted for one in offered):
        raise _no_such_standard(node, name, offered)
    # Always, whatever the present standard: stk1160 and usbtv start up in NTSC.
    node.set_standard(wanted)
    granted, scan = node.standard(), formats.scan(wanted)
    assert scan is not None, "every named standard has a scan"
    if formats.scan(granted) != scan:
        other = formats.scan(granted)
        raise DeviceRefused(
            f"{node.path} was set to {name} but is at {formats.name(granted)}"
            + (f" ({other})" if other else ""),
            f"the card does not run at {scan}; use another grabber",
        )
    return formats.name(granted), scan


def _no_such_standard(node: Node, name: str, offered: Sequence[abi.Standard]) -> DeviceRefused:
    names = ", ".join(one.name.decode("ascii", "replace") for one in offered) or "none at all"
    hint = "choose a composite or S-Video input (option 'input') or another grabber"
    known = dict.fromkeys(filter(None, (formats.scan(one.id) for one in offered)))
    if known:
        families = " or ".join(formats.family(scan) for scan in known)
        hint = f"with a camera of another standard set the option 'standard: {families}'; else {hint}"
    elif not offered:
        hint = f"{hint}; a camera without standards needs neither 'standard' nor 'field_order'"
    return DeviceRefused(f"{node.path} has no {name} at this input; its standards: {names}", hint)


class _Wanted(NamedTuple):
    """An interlaced stream to request: columns, formats and field orders, the preferred first."""

    scan: Scan
    columns: int
    exact: bool
    formats: Sequence[str]
    orders: Sequence[int]
    own_order: bool
    none_is_woven: bool

    @classmethod
    def of(cls, node: Node, options: V4l2Options, profile: Profile, scan: Scan) -> "_Wanted":
        _check_kept_to(node, options, scan)
        size = options.columns_lines
        orders = profile.field_orders if options.arrangement is None else (options.arrangement,)
        return cls(
            scan=scan,
            columns=COLUMNS if size is None else size[0],
            exact=size is not None,
            formats=_common_formats(node, options, RAW, " for fields; a card"),
            orders=orders,
            own_order=options.arrangement is not None,
            none_is_woven=profile.none_is_woven,
        )

    def lines(self, order: int) -> int:
        return self.scan.lines // 2 if order in ONE_FIELD else self.scan.lines

    def is_our_size(self, answer: abi.PixFormat) -> bool:
        fits = answer.width == self.columns if self.exact else FEWEST_COLUMNS <= answer.width <= MOST_COLUMNS
        return bool(answer.height == self.lines(answer.field) and fits)

    def is_of_use(self, answer: abi.PixFormat) -> bool:
        fourcc, order = _format_of(answer)
        fields = [a for a in Arrangement if a is not Arrangement.ANY]
        if not self.none_is_woven:
            fields.remove(Arrangement.NONE)
        return fourcc in self.formats and order in fields and self.is_our_size(answer)


def _check_kept_to(node: Node, options: V4l2Options, scan: Scan) -> None:
    """Checks that size and rate, if given, match the standard.

    Raises:
        DeviceRefused: They do not match.
    """
    family = formats.family(scan)
    others = " or ".join(
        f"'standard: {formats.family(one)}' has {one.lines} lines at {one.rate_hz:.4g} fields a second"
        for one in (SCAN_625, SCAN_525)
    )
    size = options.columns_lines
    if size is not None and size[1] != scan.lines:
        what = f"a frame of {family} has {scan.lines} lines, not {size[1]}"
        raise DeviceRefused(f"{node.path}: {what}", f"correct the option 'size': {others}")
    if options.rate_hz is not None and not is_near(options.rate_hz, scan.rate_hz):
        what = f"{family} has {scan.rate_hz:.4g} fields a second, not {options.rate_hz:g}"
        raise DeviceRefused(f"{node.path}: {what}", f"leave out the option 'rate_hz': {others}")


def _set_format(node: Node, wanted: _Wanted) -> abi.PixFormat:
    """The first request that is granted exactly, or else the first usable answer."""
    # Never FIELD_ANY: with it, several drivers silently deliver one field at half height.
    answers = []
    for order, fourcc in product(wanted.orders, wanted.formats):
        answer = _granted(node, wanted.columns, wanted.lines(order), fourcc, order)
        if answer is not None and wanted.is_our_size(answer) and _format_of(answer) == (fourcc, order):
            return answer
        answers.append(answer)
    # Later requests have changed the card's state, so a usable answer must be requested again.
    if not wanted.own_order:
        for answer in filter(None, answers):
            if wanted.is_of_use(answer) and _is_granted_again(node, answer, wanted):
                return answer
    raise _nothing_granted(node, wanted, [answer for answer in answers if answer is not None])


def _common_formats(node: Node, options: V4l2Options, readable: Collection[str], whose: str) -> Sequence[str]:
    """Readable formats that the node delivers and the options allow."""
    delivered = node.pixel_formats()
    wanted = [fourcc for fourcc in options.format if fourcc in readable]
    common = [fourcc for fourcc in wanted if fourcc in delivered]
    if not common:
        raise DeviceRefused(
            f"{node.path} delivers {', '.join(delivered) or 'no format at all'}, none of "
            f"{', '.join(wanted or readable)}",
            f"option 'format' allows {', '.join(readable)}{whose} with none of them cannot be used",
        )
    return common


def _granted(node: Node, columns: int, lines: int, fourcc: str, order: int) -> abi.PixFormat | None:
    """The format granted for a request; None if it is refused."""
    try:
        node.set_format(columns, lines, fourcc, order)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
        return None
    return node.format()


def _is_granted_again(node: Node, answer: abi.PixFormat, wanted: _Wanted) -> bool:
    again = _granted(node, wanted.columns, answer.height, *_format_of(answer))
    return again is not None and _format_of(again) == _format_of(answer) and wanted.is_our_size(again)


def _format_of(answer: abi.PixFormat) -> tuple[str, int]:
    return abi.fourcc_name(answer.pixelformat), int(answer.field)


def _nothing_granted(node: Node, wanted: _Wanted, answers: Sequence[abi.PixFormat]) -> DeviceRefused:
    requested = ", ".join(_order_name(order) for order in wanted.orders)
    got = "; ".join(dict.fromkeys(map(_in_words, answers))) or "none of them"
    lines = wanted.scan.lines
    return DeviceRefused(
        f"{node.path}: requested {wanted.columns}×{lines} (a field: {lines // 2}) in field order "
        f"{requested}, format {', '.join(wanted.formats)}; it grants {got}",
        "remove the options 'size', 'field_order' and 'format'; if that does not help, this card cannot "
        f"deliver whole {formats.family(wanted.scan)} fields",
    )


def _in_words(answer: abi.PixFormat) -> str:
    fourcc, order = _format_of(answer)
    return f"{answer.width}×{answer.height} {fourcc} {_order_name(order)}"


def _order_name(order: int) -> str:
    return Arrangement(order).name if order in list(Arrangement) else f"field {order}"


_MOST_TRIES = 8
"""Limit of requests for cameras that do not grant what they offer."""
_CANNOT = (errno.EINVAL, errno.ENOTTY)


def _set_up_progressive(node: Node, options: V4l2Options) -> tuple[abi.PixFormat, Scan]:
    """Sets format and rate.

    Returns:
        The granted format, and the camera's scan.

    Raises:
        DeviceRefused: The camera does not offer such a stream, or does not grant it.
        OSError: A call failed.
    """
    formats = _common_formats(node, options, FORMATS, "; a camera")
    modes = list(offered(node, formats, options.columns_lines, options.rate_hz))
    wanted = wishes(modes, _ranks(options), options.columns_lines, options.rate_hz)
    answers: list[str] = []
    for wish in wanted[:_MOST_TRIES]:
        answer = _granted_wish(node, wish, answers)
        if answer is not None:
            return answer
    raise _no_such_pictures(node, options, modes, answers)


def _ranks(options: V4l2Options) -> dict[str, int]:
    """Formats by preference: the installer's order, or else uncompressed before compressed."""
    if "format" in options.model_fields_set:
        return {fourcc: rank for rank, fourcc in enumerate(options.format)}
    return {fourcc: int(FORMATS[fourcc].is_compressed) for fourcc in options.format}


def _granted_wish(node: Node, wish: Wish, answers: list[str]) -> tuple[abi.PixFormat, Scan] | None:
    """The granted stream if it is the requested one; otherwise adds the answer to `answers`."""
    mode = wish.mode
    pix = _granted(node, *mode.size, mode.fourcc, Arrangement.NONE)
    if pix is None:
        return None
    # After the format, which resets the rate in many drivers.
    rate_hz = _set_rate(node, wish.rate_hz)
    got = (abi.fourcc_name(pix.pixelformat), int(pix.width), int(pix.height), int(pix.field))
    if rate_hz is None or not _keeps_to(wish, rate_hz) or got != (mode.fourcc, *mode.size, Arrangement.NONE):
        answers.append(_stream_in_words(got, rate_hz))
        return None
    return pix, Scan.progressive(mode.lines, float(rate_hz))


def _keeps_to(wish: Wish, rate_hz: Fraction) -> bool:
    return rate_hz >= LEAST_HZ and (wish.rate_hz is None or is_near(rate_hz, wish.rate_hz))


def _set_rate(node: Node, rate_hz: Fraction | None) -> Fraction | None:
    """Requests a rate; returns the granted one, or None if the camera does not report it."""
    try:
        if rate_hz is not None:
            node.set_interval(1 / rate_hz)
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
    try:
        interval = node.interval()
    except OSError as error:
        if error.errno not in _CANNOT:
            raise
        return None
    return None if interval is None else 1 / interval


def _stream_in_words(got: tuple[str, int, int, int], rate_hz: Fraction | None) -> str:
    fourcc, columns, lines, field = got
    rate = "an unknown rate" if rate_hz is None else f"{float(rate_hz):.4g} a second"
    fields = "" if field == Arrangement.NONE else f" in field order {_arrangement_name(field)}"
    return f"{fourcc} {columns}×{lines}{fields} at {rate}"


def _arrangement_name(field: int) -> str:
    return Arrangement(field).name if field in list(Arrangement) else str(field)


def _no_such_pictures(
    node: Node, options: V4l2Options, modes: Iterable[Mode], answers: Iterable[str]
) -> DeviceRefused:
    asked = [] if options.size is None else [f"size {options.size}"]
    asked += [] if options.rate_hz is None else [f"{options.rate_hz:g} pictures a second"]
    asked.append(f"format {', '.join(options.format)}")
    grants = "; ".join(dict.fromkeys(answers))
    return DeviceRefused(
        f"{node.path}: requested progressive pictures, {', '.join(asked)}; "
        + (f"it grants {grants}, and " if grants else "")
        + f"it offers {in_words(list(modes))}",
        f"choose what it offers (options 'size', 'rate_hz' of {LEAST_HZ} or more, 'format')",
    )
