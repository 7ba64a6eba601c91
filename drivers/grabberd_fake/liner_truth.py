"""Truth of the liner: places, strain, contact pressure and load at a time; its quantities over a pulsation.

Names and definitions of the quantities are those of the table `quantities` of an analysis: times of the wall,
phases of the vacuum, compression and load. They are read from the solved wall at every millisecond of one
settled period.
"""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd_fake.liner import Liner, in_object_frame, movement, patch_places
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.optics import Array
from grabberd_fake.options import FakeOptions
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_fake.wall_states import (
    Patch,
    TeatLoad,
    WallStates,
    buckling_kpa,
    stiffness_n_mm,
    teat_load,
    touch_kpa,
    unit_normals,
    wall_states,
)


class WallPlaces(NamedTuple):
    """A grid of material places on the liner.

    Attributes:
        x_mm: (R,) along the mounted liner from half way, away from the mouthpiece: up to ±65 mm.
        theta: (C,) angles round the mounted liner from the line that faces the cameras, towards Y: up to ±π.
    """

    x_mm: Array
    theta: Array


class LinerTruth(NamedTuple):
    """Truth at N material places, row by row, and of the whole liner.

    Vectors are in the object's frame. Tensors are in orthonormal bases of the face: 0 along the tube, 1
    perpendicular to it, towards increasing angle.

    Attributes:
        ids: (N,) int32, from 1; those of the targets if no other places were asked for.
        x_mm: (N,) and `theta`: (N,) the places, as in `WallPlaces`.
        target_mm: (N, 3) centres of targets that stand there; `face_mm`: (N, 3) places of the outer face.
        normal: (N, 3) outward; `basis`: (N, 2, 3) the present basis.
        strain: (N, 2, 2) Green-Lagrange strain of the outer face since the reference, in the basis of then.
        contact_kpa: (N,) contact pressure on the inner face behind the places.
        load_x_mm: (K,) X of the middles of elements of the liner's length; `load_n_per_mm`: (K,) load over
            each on the side that faces the cameras, of teat and opposite wall; `load_n`: all of it.
        teat: load on the teat alone; None for an empty liner.
        difference_kpa: pressure difference of the gases, outside over inside.
        rest_kpa: pressure difference at which the wall would rest where it is; less or more while it is late.
        pulsation_kpa: vacuum in the pulsation chamber; `liner_kpa`: in the liner.
    """

    ids: NDArray[np.int32]
    x_mm: Array
    theta: Array
    target_mm: Array
    face_mm: Array
    normal: Array
    basis: Array
    strain: Array
    contact_kpa: Array
    load_x_mm: Array
    load_n_per_mm: Array
    load_n: float
    teat: TeatLoad | None
    difference_kpa: float
    rest_kpa: float
    pulsation_kpa: float
    liner_kpa: float


def truth_of_liner(
    options: FakeOptions | Mapping[str, Any],
    time_ns: int,
    places: WallPlaces | None = None,
    reference_ns: int | None = None,
) -> LinerTruth:
    """Truth of the liner at a time.

    Args:
        options: options of `FakeGrabber`; the scene has to be `liner`.
        time_ns: time of a field, or any other time on the same clock.
        places: where on the wall; by default under the targets.
        reference_ns: time of the strain's reference; by default the mounted liner, without a pressure
            difference.

    Raises:
        ValueError: the options are invalid, or the scene is another one.
    """
    options = options if isinstance(options, FakeOptions) else FakeOptions.read(options)
    if options.scene != "liner":
        raise ValueError(f"scene: {options.scene!r} is not the solved wall 'liner'")
    liner = options.liner
    moves = movement(liner)
    reference_kpa = 0.0 if reference_ns is None else moves.rest_kpa(reference_ns)
    difference_kpa = moves.difference_kpa(time_ns)
    places = places or WallPlaces(*patch_places(liner))
    return _truth(liner, places, difference_kpa, moves.rest_kpa(time_ns), reference_kpa)


def _truth(
    options: LinerOptions, places: WallPlaces, difference_kpa: float, rest_kpa: float, reference_kpa: float
) -> LinerTruth:
    states = wall_states(options.wall)
    patch = _patch(options.wall, tuple(places.x_mm.tolist()), tuple(places.theta.tolist()))
    face, along, around = patch.frames(states.outer_mm(rest_kpa)).reshape(3, -1, 3)
    normal = unit_normals(along, around)
    borders_mm, force = states.borders_mm(rest_kpa), states.force_n_per_mm(rest_kpa)
    x_mm, theta = np.broadcast_arrays(places.x_mm[:, np.newaxis], places.theta)
    return LinerTruth(
        ids=np.arange(1, x_mm.size + 1, dtype=np.int32),
        x_mm=x_mm.ravel(),
        theta=theta.ravel(),
        target_mm=in_object_frame(options, face + normal * options.target_thickness_mm),
        face_mm=in_object_frame(options, face),
        normal=normal,
        basis=_basis(along, around),
        strain=_strain((along, around), patch.frames(states.outer_mm(reference_kpa)).reshape(3, -1, 3)[1:]),
        contact_kpa=patch.values(states.contact_kpa(rest_kpa)).ravel(),
        load_x_mm=(borders_mm[1:] + borders_mm[:-1]) / 2 - options.patch_x_mm,
        load_n_per_mm=force,
        load_n=float(force @ np.diff(borders_mm)),
        teat=None if states.about["teat"] is None else teat_load(states, rest_kpa),
        difference_kpa=difference_kpa,
        rest_kpa=rest_kpa,
        pulsation_kpa=options.wave.liner_kpa - difference_kpa,
        liner_kpa=options.wave.liner_kpa,
    )


@lru_cache(maxsize=8)
def _patch(wall: str, x_mm: tuple[float, ...], theta: tuple[float, ...]) -> Patch:
    return Patch(wall_states(wall), np.array(x_mm), np.array(theta))


def _basis(along: Array, around: Array) -> Array:
    """(N, 2, 3) orthonormal: along the first tangent, and perpendicular to it in the face."""
    first = along / np.linalg.norm(along, axis=-1, keepdims=True)
    second = around - (around * first).sum(axis=-1, keepdims=True) * first
    return np.stack([first, second / np.linalg.norm(second, axis=-1, keepdims=True)], axis=-2)


def _strain(present: tuple[Array, Array], reference: Array) -> Array:
    """(N, 2, 2) (FᵀF − 1)/2 of tangents (2, N, 3), in the reference's basis."""
    before = np.moveaxis(reference, 0, 1)  # (N, 2, 3), a tangent a row
    in_basis = before @ np.swapaxes(_basis(*reference), -1, -2)
    gradient = np.linalg.solve(in_basis, np.stack(present, axis=1))
    return (gradient @ np.swapaxes(gradient, -1, -2) - np.eye(2)) / 2


_STEPS_PER_S = 1000
_AT_FULL_CLOSURE = "liner_compression_teat_end_at_full_closure_kpa"
_ISO_KPA = 4.0
_PASSED = 0.1
"""Share of the stroke from its ends between which the wall opens or closes."""
_LASER_MM = 1.0
"""The same in laser studies."""
_ARC_MM, _ARC_PLACES = 10.0, 41
"""Half the arc that compression is averaged over, on the wall's middle, and places along it."""
_COMPRESSIONS = tuple(f"liner_compression_{which}_kpa" for which in ("mean", "greatest", "teat_end"))
_HEIGHT_MM = 0.25
_END_SHARE = 0.5
"""Of the greatest compression: below it, the teat has ended."""
_END_MM = 10.0
"""Length of tube up to the teat's end over which compression there is averaged."""


def quantities_of(
    options: LinerOptions, flow_stop_kpa: float | None = None, flow_stop_difference_kpa: float | None = None
) -> dict[str, float]:
    """Quantities by name: of the liner itself without a teat, of the milking liner with one.

    Args:
        options: of the liner.
        flow_stop_kpa: contact pressure at the teat's end at which milk just stops flowing; None leaves out
            what follows from it.
        flow_stop_difference_kpa: pressure difference across the wall at which it does; likewise.

    Raises:
        ValueError: the liner is on a teat, and no vacuum moves it.
    """
    states = wall_states(options.wall)
    if states.about["teat"] is None:
        return {
            "touch_kpa": touch_kpa(states),
            "buckling_kpa": buckling_kpa(states),
            "stiffness_n_mm": stiffness_n_mm(states),
        }
    if options.vacuum.system_kpa <= 2 * _ISO_KPA:
        raise ValueError(f"vacuum.system_kpa: {options.vacuum.system_kpa:g} moves no liner as in milking")
    of_load = closed_liner_quantities(options, _closed_kpa(options))
    at_end_kpa = of_load.pop(_AT_FULL_CLOSURE)
    if flow_stop_kpa is not None:
        of_load["teat_end_beyond_flow_stop_kpa"] = at_end_kpa - flow_stop_kpa
        of_load |= _overpressure(options, "map", _occluding_kpa(options, flow_stop_kpa))
    if flow_stop_difference_kpa is not None:
        of_load |= _overpressure(options, "derived", flow_stop_difference_kpa)
        of_load["flow_duration_s"] = _flow_duration_s(options, flow_stop_difference_kpa)
    return _of_the_movement(options) | _of_the_vacuum(options) | of_load


def _overpressure(options: LinerOptions, way: str, stop_kpa: float) -> dict[str, float]:
    """The difference at flow stop, and that in phase d, in which the chamber is at atmosphere, less it."""
    over_kpa = options.wave.liner_kpa - stop_kpa
    return {f"flow_stop_{way}_kpa": stop_kpa, f"overpressure_{way}_kpa": over_kpa}


def _flow_duration_s(options: LinerOptions, stop_kpa: float) -> float:
    """Duration for which a trapezoid has more vacuum than the liner's less the difference at flow stop."""
    vacuum = options.vacuum
    above = 1 - (options.wave.liner_kpa - stop_kpa) / vacuum.system_kpa
    return (vacuum.open + (vacuum.rising + vacuum.falling) * above) * options.period_s


def _occluding_kpa(options: LinerOptions, flow_stop_kpa: float) -> float:
    """Pressure difference at which the last of the teat is pressed by so much, by halving."""
    states, high = wall_states(options.wall), options.wave.liner_kpa
    end_mm = closed_liner_quantities(options, [high])["teat_end_x_mm"]
    low = 0.0
    for _ in range(30):
        middle = (low + high) / 2
        section = _Sections(options, states, middle)
        last = (section.x_mm < end_mm) & (section.x_mm > end_mm - _END_MM)
        pressed = np.average(section.compression_kpa[last], weights=section.spans_mm[last]) > flow_stop_kpa
        low, high = (low, middle) if pressed else (middle, high)
    return (low + high) / 2


def _of_the_movement(options: LinerOptions) -> dict[str, float]:
    """Times of the wall, and how long after the vacuum it is halfway."""
    part, stroke, stroke_mm = _stroke(options)
    opening, closing = (_passage(part, stroke, 0.5, rising=rising) for rising in (True, False))
    kpa = pulsation_kpa(options, part * options.period_s) / options.vacuum.system_kpa
    lags = [
        (wall - _passage(part, kpa, 0.5, rising=rising) + 0.5) % 1 - 0.5
        for wall, rising in ((opening, True), (closing, False))
    ]
    times = _times(options, _PASSED)
    by_1mm = {
        f"liner_{word}_1mm_s": time_s for word, time_s in _times(options, _LASER_MM / stroke_mm).items()
    }
    return {
        **{f"liner_{word}_s": times[word] for word in ("opening", "open", "closing")},
        "massage_time_s": times["closed"],
        "wall_ratio": (times["opening"] + times["open"]) / options.period_s,
        **by_1mm,
        "opening_lag_s": lags[0] * options.period_s,
        "closing_lag_s": lags[1] * options.period_s,
    }


def _times(options: LinerOptions, share: float) -> dict[str, float]:
    """Durations of the wall's phases between levels at this share of the stroke from its ends."""
    part, stroke, _ = _stroke(options)
    levels = ((share, True), (1 - share, True), (1 - share, False), (share, False))
    passed = [_passage(part, stroke, level, rising=rising) for level, rising in levels]
    lasts = np.mod(np.roll(passed, -1) - passed, 1.0) * options.period_s
    return dict(zip(("opening", "open", "closing", "closed"), lasts.tolist(), strict=True))


def _of_the_vacuum(options: LinerOptions) -> dict[str, float]:
    """ISO phases of the trapezoid, by thresholds 4 kPa over atmosphere and 4 kPa under its maximum."""
    vacuum = options.vacuum
    edge = _ISO_KPA / vacuum.system_kpa
    a, c = vacuum.rising * (1 - 2 * edge), vacuum.falling * (1 - 2 * edge)
    b = vacuum.open + (vacuum.rising + vacuum.falling) * edge
    return {
        "rate_per_min": 60 / options.period_s,
        "pulsator_ratio": a + b,
        "phase_a_s": a * options.period_s,
        "phase_b_s": b * options.period_s,
        "phase_c_s": c * options.period_s,
        "phase_b_share": b,
        "phase_d_share": 1 - a - b - c,
        "phase_d_s": (1 - a - b - c) * options.period_s,
    }


def _closed_kpa(options: LinerOptions) -> list[float]:
    """Pressure differences of the states shown, a millisecond apart, while the wall is in phase d."""
    part, stroke, _ = _stroke(options)
    closed_from = _passage(part, stroke, _PASSED, rising=False)
    lasts = (_passage(part, stroke, _PASSED, rising=True) - closed_from) % 1
    count = math.ceil(lasts * options.period_s * _STEPS_PER_S)
    at = (closed_from + lasts * (np.arange(count) + 0.5) / count) % 1
    return [movement(options).rest_kpa(round(one * options.period_s * 1e9)) for one in at.tolist()]


def closed_liner_quantities(options: LinerOptions, outer_kpa: Sequence[float]) -> dict[str, float]:
    """Compression and load of the closed liner, mean over states; the teat's end and its place.

    Args:
        options: of the liner, on a teat.
        outer_kpa: pressure difference of each state.
    """
    states = wall_states(options.wall)
    sections = [_Sections(options, states, kpa) for kpa in outer_kpa]
    compression = np.mean([one.compression_kpa for one in sections], axis=0)
    load = np.mean([one.load_n_per_mm for one in sections], axis=0)
    spans = np.mean([one.spans_mm for one in sections], axis=0)
    x_mm = sections[0].x_mm
    # Below the teat walls meet and press each other, so its greatest is sought down to where it ends at most.
    above = x_mm < states.about["teat"]["end_x_mm"] - options.patch_x_mm
    peak = int(compression[above].argmax())
    last = peak + int(np.argmax(compression[peak:] < _END_SHARE * compression[peak]))
    teat, end_mm = np.arange(len(x_mm)) < last, float(x_mm[last]) - _HEIGHT_MM / 2
    near_end = teat & (x_mm > end_mm - _END_MM)
    fullest = max(sections, key=lambda one: float(one.load_n_per_mm @ (teat * one.spans_mm)))
    mean_kpa = float(np.average(compression[teat], weights=spans[teat]))
    found = {
        "liner_compression_mean_kpa": mean_kpa,
        "liner_compression_greatest_kpa": float(compression[teat].max()),
        "liner_compression_greatest_x_mm": float(x_mm[teat][compression[teat].argmax()]),
        "liner_compression_teat_end_kpa": float(np.average(compression[near_end], weights=spans[near_end])),
        "teat_end_x_mm": end_mm,
        "teat_load_peak_n_per_mm": float(load[teat].max()),
        "teat_load_n": float(load[teat] @ spans[teat]),
        _AT_FULL_CLOSURE: float(
            np.average(fullest.compression_kpa[near_end], weights=fullest.spans_mm[near_end])
        ),
    }
    return found | {
        name.replace("_kpa", "_above_atmosphere_kpa"): found[name] - options.wave.liner_kpa
        for name in _COMPRESSIONS
    }


class _Sections:
    """Sections of the wall from the first row of targets to the last, in one state.

    Attributes:
        x_mm: (H,) on the mounted tube, in the object's frame.
        compression_kpa: (H,) mean over the arc; `load_n_per_mm`: on one side, per present length.
        spans_mm: (H,) present length of tube that each section stands for.
    """

    def __init__(self, options: LinerOptions, states: WallStates, outer_kpa: float) -> None:
        rows_mm, _ = patch_places(options)
        mounted_mm = np.arange(rows_mm[0] + _HEIGHT_MM / 2, rows_mm[-1], _HEIGHT_MM)
        arc = np.linspace(-1, 1, _ARC_PLACES) * _ARC_MM / float(states.about["design"]["radius_mm"])
        self.x_mm = mounted_mm - options.patch_x_mm
        under_arc = Patch(states, mounted_mm, arc).values(states.contact_kpa(outer_kpa))
        # Quadratic elements swing below zero beside a contact's edge.
        self.compression_kpa = np.maximum(under_arc, 0.0).mean(axis=1)
        self.load_n_per_mm = self._load(states, outer_kpa, mounted_mm)
        borders = np.append(mounted_mm - _HEIGHT_MM / 2, mounted_mm[-1] + _HEIGHT_MM / 2)
        self.spans_mm = np.diff(np.interp(borders, states.x_mm[::2], states.borders_mm(outer_kpa)))

    def _load(self, states: WallStates, outer_kpa: float, mounted_mm: Array) -> Array:
        """(H,) the force over each element, spread over it as the compression is."""
        force = states.force_n_per_mm(outer_kpa)
        element = np.searchsorted(states.x_mm[::2], mounted_mm, side="right") - 1
        whole = np.bincount(element, self.compression_kpa, len(force)) / np.maximum(
            np.bincount(element, minlength=len(force)), 1
        )
        return force[element] * self.compression_kpa / np.maximum(whole[element], 1e-9)


@lru_cache(maxsize=8)
def _stroke(options: LinerOptions) -> tuple[Array, Array, float]:
    """Parts of a period, the targets' first principal movement there, from 0 closed to 1 open, and its size.

    The size is that of the target that moves most, in mm.
    """
    part = np.arange(round(options.period_s * _STEPS_PER_S)) / round(options.period_s * _STEPS_PER_S)
    scene = Liner(options)
    places = np.stack(
        [scene.targets(round(one * options.period_s * 1e9)).xyz_mm.ravel() for one in part.tolist()]
    )
    moved = places - places.mean(axis=0)
    direction = np.linalg.svd(moved, full_matrices=False)[2][0]
    stroke: NDArray[np.float64] = moved @ direction
    most_mm = float(np.ptp(stroke) * np.linalg.norm(direction.reshape(-1, 3), axis=1).max())
    stroke *= np.sign(np.corrcoef(stroke, pulsation_kpa(options, part * options.period_s))[0, 1])
    return part, (stroke - stroke.min()) / np.ptp(stroke), most_mm


def _passage(part: Array, values: Array, level: float, rising: bool) -> float:
    """Part of the period at which a periodic series passes a level."""
    above = values - level if rising else level - values
    following = np.roll(above, -1)
    (at,) = np.flatnonzero((above < 0) & (following >= 0))
    share = above[at] / (above[at] - following[at])
    return float((part[at] + share / len(part)) % 1)
