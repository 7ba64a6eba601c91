"""Fields of the calibration frame in, both virtual cameras out (paper 3.6, figure 8)."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration import (
    Adjustment,
    Blunder,
    Elimination,
    FieldImages,
    Identification,
    IdentificationSettings,
    LocalFieldTrial,
    Mark,
    MeanImages,
    Network,
    Unknowns,
    Validation,
    check_depth,
    check_rank,
    compare,
    cross_validate,
    eliminate,
    handedness_hint,
    identify_by_hand,
    identify_frame,
    mean_images,
    normality,
    stillness,
    symmetries,
    target_to_add,
    try_local_fields,
    undecided,
    volume_sigma,
    with_stated_covariance,
    with_unmodelled,
    without_blunders,
)
from grabberd.errors import MeasurementError, RankDeficient
from grabberd.field import NumberedField
from grabberd.geometry import PARAMETERS, NominalRig, View
from grabberd.measurement import LocationSettings, measure
from grabberd.processes.calibration.calibration_result import CalibrateResult, CalibrateSettings
from grabberd.processes.locating import whole
from grabberd.reconstruction import ObjectModel

Array = NDArray[np.float64]

# f, x0, y0: a planar target field does not separate them from the camera's position.
INTERIOR = PARAMETERS[:3]
MOST_BLUNDERS = 0.1
# An image point off by a pixel is a wrong identity or a wrong certificate, not an uneven mirror.
MOST_UNMODELLED_PX = 1.0
BLOCKS = 6
"""Blocks of targets that cross-validation holds out in turn."""


def calibrate(
    fields: Iterable[NumberedField],
    nominal: NominalRig,
    frame: ObjectModel,
    settings: CalibrateSettings | None = None,
    by_hand: Sequence[Mark] | None = None,
) -> CalibrateResult:
    """Calibrates both virtual cameras from fields of the calibration frame, which stands still.

    Args:
        fields: any number, of both parities.
        nominal: the rig as it was built, each number to ten per cent.
        frame: the calibration frame's targets.
        settings: settings of the calibration.
        by_hand: identifications made by hand, in place of automatic ones.

    Raises:
        MeasurementError: no fields, a calibration frame that moves, too few targets, a planar calibration
            frame, an unclear identification, or no convergence; the message says which.
    """
    settings = settings or CalibrateSettings()
    _check_depth(frame, settings)
    if by_hand is None:
        _check_symmetry(frame, settings, IdentificationSettings().margin)
    seen, bits, y_step = located(fields, nominal, settings.location)
    images = (mean_images(seen[0]), mean_images(seen[1]))
    identification = _identify(nominal, frame, images, settings, by_hand)
    network = network_of(images, identification, frame, settings)
    network = network.starting_from([*_held_as_built(network.views, nominal, settings)])
    done, local = _explained(network, settings, nominal)
    final = _final(done, local, settings)
    validation, unvalidated = _validated(done.adjustment)
    still_left, still_right = (stillness(*one) for one in zip(seen, images, strict=True))
    pointing_px = _pointing_px(images)
    return CalibrateResult(
        frame=frame,
        nominal=nominal,
        settings=settings,
        bits=bits,
        y_step=y_step,
        images=images,
        identification=identification,
        adjustment=done.adjustment,
        elimination=done.elimination,
        blunders=done.blunders,
        unmodelled_px=done.unmodelled_px,
        local=local,
        final=final,
        differences=compare(done.adjustment),
        normality=normality(done.adjustment),
        validation=validation,
        volume=volume_sigma(final, pointing_px, local_fields=local.fields if local else ()),
        pointing_px=pointing_px,
        unvalidated=unvalidated,
        stillness=(still_left, still_right),
        disc_share=_disc_share(seen, done.adjustment.views, frame),
        view_sigma_px=_view_sigma_px(seen),
    )


def _check_symmetry(frame: ObjectModel, settings: CalibrateSettings, margin: float) -> None:
    """Check that a view of the whole frame has one explanation only."""
    alike = undecided(frame, margin, handed=settings.handedness is not None)
    if not alike:
        return
    nearly = [one for one in symmetries(frame) if one.kind == "shift" and one.cost < 4 * margin]
    said = dict.fromkeys(map(str, (*alike, *nearly[:2])))
    x, y, z = target_to_add(frame, alike)
    raise MeasurementError(
        f"calibration frame {frame.name} cannot be told from itself: {'; '.join(said)}",
        f"add a target at x {x:.1f}, y {y:.1f}, z {z:.1f} mm to the frame and to its file, or identify some "
        "targets by hand",
    )


def _check_depth(frame: ObjectModel, settings: CalibrateSettings) -> None:
    """Check that the targets are not coplanar if interior parameters are adjusted."""
    if interior := [name for name in settings.free if name.rpartition(".")[2] in INTERIOR]:
        check_depth(frame.xyz_mm, interior, f"the targets of calibration frame {frame.name}")


def located(
    fields: Iterable[NumberedField], nominal: NominalRig, location: LocationSettings
) -> tuple[tuple[list[FieldImages], list[FieldImages]], int, int]:
    """Whole blobs of every field by view, with the fields' bits and line step."""
    sides: tuple[list[FieldImages], list[FieldImages]] = ([], [])
    packed = None
    for numbered in fields:
        packed = numbered.packed
        blobs = measure(packed, None, location)
        for side, half in zip(sides, (nominal.left, nominal.right), strict=True):
            own = whole(blobs, *half)
            side.append(
                FieldImages(
                    blobs.xy_px[own],
                    blobs.sigma_px[own],
                    packed.parity,
                    blobs.common_px[own],
                    blobs.area_px[own],
                )
            )
    if packed is None:
        raise MeasurementError("the capture has no field to calibrate from", "take the capture again")
    return sides, packed.bits, packed.y_step


def _identify(
    nominal: NominalRig,
    frame: ObjectModel,
    images: tuple[MeanImages, MeanImages],
    settings: CalibrateSettings,
    by_hand: Sequence[Mark] | None,
) -> Identification:
    believed = IdentificationSettings(handedness=(settings.handedness, settings.handedness))
    left, right = (side.xy_px for side in images)
    if by_hand is None:
        return identify_frame(nominal, frame, left, right, believed)
    return identify_by_hand(nominal, frame, left, right, by_hand, believed)


def network_of(
    images: tuple[MeanImages, MeanImages],
    identification: Identification,
    frame: ObjectModel,
    settings: CalibrateSettings,
) -> Network:
    """The identified images of both views as a network to adjust."""
    targets = [side.target for side in (identification.left, identification.right)]
    known = [target >= 0 for target in targets]
    sigma = np.concatenate([side.sigma_px[own] for side, own in zip(images, known, strict=True)])
    if settings.equal_weights:
        sigma = np.full_like(sigma, np.sqrt(np.mean(sigma**2)))
    place_sigma = 0.0 if settings.held else frame.sigma_mm
    return Network(
        views=identification.views,
        view=np.repeat([0, 1], [int(own.sum()) for own in known]),
        target=np.concatenate([target[own] for target, own in zip(targets, known, strict=True)]),
        xy_px=np.concatenate([side.xy_px[own] for side, own in zip(images, known, strict=True)]),
        sigma_px=sigma,
        target_mm=frame.xyz_mm,
        target_sigma_mm=np.full_like(frame.xyz_mm, place_sigma),
        ids=frame.target,
    )


def _held_as_built(
    views: tuple[View, ...], nominal: NominalRig, settings: CalibrateSettings
) -> Iterator[View]:
    """The views with their nominal values for all interior parameters that are not adjusted."""
    handedness = views[0].handedness, views[1].handedness
    for view, built in zip(views, nominal.views(handedness), strict=True):
        free = [name in settings.free or f"{view.name}.{name}" in settings.free for name in PARAMETERS]
        own = np.array(free) | np.isin(PARAMETERS, PARAMETERS[3:9])
        # Identification fits some interior parameters of its own to find the targets: what is held must be
        # held at the nominal value, not at that by-product. The pose (3 to 8) stays as the starting value.
        yield view.with_vector(np.where(own, view.vector(), built.vector()))


@dataclass(frozen=True, slots=True, eq=False)
class _Adjusted:
    """The adjusted functional model, with the blunders, tests and weights that led to it."""

    adjustment: Adjustment
    blunders: tuple[Blunder, ...]
    elimination: Elimination | None
    unmodelled_px: float


def _explained(
    network: Network, settings: CalibrateSettings, nominal: NominalRig
) -> tuple[_Adjusted, LocalFieldTrial | None]:
    """Adjust and try local fields; if nothing fits, say whether mirrored halves are the reason."""
    try:
        done = _adjusted(network, settings)
        return done, _local(done, nominal, settings)
    except MeasurementError as error:
        hint = handedness_hint([view.handedness for view in network.views], nominal.handedness)
        if hint is None or isinstance(error, RankDeficient):
            raise
        raise MeasurementError(error.message, hint) from error


def _adjusted(network: Network, settings: CalibrateSettings) -> _Adjusted:
    unknowns = Unknowns.of(network.views, settings.free, shared=settings.shared, tied=settings.tied)
    check_rank(network, unknowns)
    adjustment, blunders, unmodelled_px = _sound(network, unknowns)
    if unmodelled_px > MOST_UNMODELLED_PX:
        raise MeasurementError(
            f"the image points are off by {unmodelled_px:.2f} px from any rig of this model",
            "adjust more parameters, and check which target is which and the calibration frame's file",
        )
    elimination = None
    if settings.alpha is not None:
        clean = adjustment.network.starting_from(adjustment.views)
        elimination = eliminate(clean, unknowns, settings.alpha)
        adjustment = elimination.adjustment
    return _Adjusted(adjustment, blunders, elimination, unmodelled_px)


def _sound(network: Network, unknowns: Unknowns) -> tuple[Adjustment, tuple[Blunder, ...], float]:
    """Adjust without blunders and with realistic weights, alternating, since each depends on the other."""
    blunders: tuple[Blunder, ...] = ()
    # One blunder inflates the unmodelled share and so hides the next: it is estimated again after each
    # removal. With more than a tenth removed the fault is not in single points; it stops there.
    while True:
        # Means of many fields are known better than mirrors are even. By their own σ alone σ0 came out near
        # 5, good points left as blunders, and the few with the least scatter decided everything.
        weighted, unmodelled_px = with_unmodelled(network, unknowns)
        adjustment, more = without_blunders(weighted, unknowns)
        blunders += more
        if not more or len(blunders) > MOST_BLUNDERS * len(weighted):
            return adjustment, blunders, unmodelled_px
        network = network.select(_kept(network, adjustment.network)).starting_from(adjustment.views)


def _kept(network: Network, part: Network) -> NDArray[np.bool_]:
    """(M,) True for image points of a network that are also in a part of it."""
    count = len(network.target_mm)
    return np.isin(network.view * count + network.target, part.view * count + part.target)


def _local(done: _Adjusted, nominal: NominalRig, settings: CalibrateSettings) -> LocalFieldTrial | None:
    if not settings.local_field:
        return None
    # Collocation explains what the weights only allowed for, and so needs the points' own σ again.
    return try_local_fields(done.adjustment, nominal.lines, unmodelled_px=done.unmodelled_px)


def _final(done: _Adjusted, local: LocalFieldTrial | None, settings: CalibrateSettings) -> Adjustment:
    """The calibration's own adjustment, with all that is not known of it."""
    adjustment = local.adjustment if local else done.adjustment
    unknowns = Unknowns.of(adjustment.views, settings.free, shared=settings.shared, tied=settings.tied)
    return with_stated_covariance(adjustment, unknowns)


def _pointing_px(images: tuple[MeanImages, MeanImages]) -> tuple[float, float]:
    """σ of one field's image coordinates in x and y: scatter between fields, and the part common to all."""
    variance = [np.nan_to_num(side.scatter_px) ** 2 + side.sigma_px**2 for side in images]
    x, y = np.sqrt(np.concatenate(variance).mean(axis=0)).tolist()
    return x, y


def _view_sigma_px(seen: tuple[list[FieldImages], list[FieldImages]]) -> tuple[float, float]:
    """Median pointing σ of one field in each view."""
    left, right = (float(np.median(np.concatenate([one.sigma_px for one in side]))) for side in seen)
    return left, right


def _disc_share(
    seen: tuple[list[FieldImages], list[FieldImages]], views: tuple[View, ...], frame: ObjectModel
) -> tuple[float, float]:
    """Median area of the targets in each view, over that of a disc's geometric image."""
    left, right = (
        float(np.median(np.concatenate([one.area_px for one in side if one.area_px is not None])))
        / _disc_area_px(view, frame)
        for side, view in zip(seen, views, strict=True)
    )
    return left, right


def _disc_area_px(view: View, frame: ObjectModel) -> float:
    away_mm = float(np.linalg.norm(view.center_mm - frame.xyz_mm.mean(axis=0)))
    diameter_mm = frame.target_diameter_mm * view.f_mm / away_mm
    return float(np.pi / 4 * diameter_mm**2 / (view.pixel_x_mm * view.pixel_y_mm))


def _validated(adjustment: Adjustment) -> tuple[Validation | None, str]:
    """Cross-validation of the global model, or the reason why too few targets are left for it."""
    network = adjustment.network.starting_from(adjustment.views)
    try:
        return cross_validate(network, adjustment.unknowns, BLOCKS), ""
    except MeasurementError as error:
        return None, error.message
