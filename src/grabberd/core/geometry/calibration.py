"""Calibration of a rig: both views, their covariance and their provenance, as a JSON document."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.geometry.document_reader import Reading, is_number
from grabberd.core.geometry.local_field import LocalField
from grabberd.core.geometry.view import PARAMETERS, Polynomial, View
from grabberd.errors import CalibrationMismatch

SCHEMA = "grabberd/calibration/1"
LARGEST_SIDE_PX = 4096
"""Lines or columns of a picture, as those that fields may have; neither room knows the other."""

_IMAGES, _CENTRES, _CORRELATION = "image_model", "disc_centres", "local_correlation"
"""Among the details, where documents of earlier versions have nothing, and these versions read nothing."""
_KEYS = (
    "schema",
    "id",
    "created_utc",
    "source",
    "image",
    "views",
    "covariance",
    "sigma0_px",
    "glass",
    "details",
)
_POLYNOMIALS: tuple[Polynomial, ...] = ("distortion", "correction")
_EXTENT = ("first_column", "end_column", "pixel_x_mm", "pixel_y_mm", "handedness")
_GLASS = ("thickness_mm", "refractive_index")
_SIZE = 2 * len(PARAMETERS)
_ROUNDING = 1e-6
"""Of correlations: by how much rounding may make a covariance of hardly separable parameters lopsided, or
negative, without harm to any σ."""
_HINT = "fix the file, or calibrate again"


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Two calibrated virtual cameras.

    Attributes:
        id: Name of this calibration.
        created_utc: Time of creation, ISO 8601.
        source: Description of its origin, for people.
        columns: Picture width in pixels.
        lines: Picture height in frame lines.
        left: The left view.
        right: The right view.
        covariance: (36, 36) float64 of the left, then the right view's `PARAMETERS`; zero where a parameter
            was held.
        sigma0_px: Standard deviation of unit weight, or None if nothing was adjusted.
        glass: thickness_mm and refractive_index of the plate that was in place, or None.
        local_fields: Displacement fields of the left and right view beyond the model; None if not known.
        details: Rest of the document (certificate, temperature, protocol …), carried along unread but for
            what the images are taken for (`disc_centres`, `local_correlation`).
    """

    id: str
    created_utc: str
    source: str
    columns: int
    lines: int
    left: View
    right: View
    covariance: Array
    sigma0_px: float | None = None
    glass: Mapping[str, float] | None = None
    local_fields: tuple[LocalField | None, LocalField | None] = (None, None)
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def views(self) -> tuple[View, View]:
        """The left and the right view."""
        return self.left, self.right

    @property
    def disc_centres(self) -> bool:
        """True if it was made of the centres of discs, not of the middles of their pictures.

        Points measured with it then have to be moved to the centres; with one made of the middles they must
        not, because it has taken up most of the difference.
        """
        return bool((self.details.get(_IMAGES) or {}).get(_CENTRES, False))

    @property
    def local_correlation(self) -> tuple[float, float]:
        """Correlation of the errors of both local fields in x and in y, at images of one point."""
        x, y = (self.details.get(_IMAGES) or {}).get(_CORRELATION, (0.0, 0.0))
        return x, y

    @classmethod
    def from_document(cls, document: Mapping[str, Any]) -> "Calibration":
        """Read a calibration from its JSON document.

        Raises:
            InputError: The schema, a key or a value is invalid; the message lists every problem.
        """
        reading = Reading("the calibration")
        _check_schema(reading, document)
        image, views = reading.mapping(document, "image"), reading.mapping(document, "views")
        reading.keys("image.", image, ("columns", "lines"))
        reading.keys("views.", views, ("left", "right"))
        calibration = cls(
            id=reading.text(document, "id"),
            created_utc=_time(reading, document),
            source=reading.text(document, "source"),
            columns=reading.integer(image, "columns", "image.", least=1, most=LARGEST_SIDE_PX),
            lines=reading.integer(image, "lines", "image.", least=1, most=LARGEST_SIDE_PX),
            left=_view(reading, views, "left"),
            right=_view(reading, views, "right"),
            covariance=_covariance(reading, document.get("covariance")),
            sigma0_px=reading.number(document, "sigma0_px")
            if document.get("sigma0_px") is not None
            else None,
            glass=_glass(reading, document),
            local_fields=(_local_field(reading, views, "left"), _local_field(reading, views, "right")),
            details=_details(reading, document),
        )
        _check_halves(reading, calibration)
        reading.finish(_HINT)
        return calibration

    def to_document(self) -> dict[str, Any]:
        """Convert to the JSON document; `from_document` restores the same calibration bit for bit."""
        return {
            "schema": SCHEMA,
            "id": self.id,
            "created_utc": self.created_utc,
            "source": self.source,
            "image": {"columns": self.columns, "lines": self.lines},
            "views": {
                view.name: _view_document(view, field)
                for view, field in zip(self.views, self.local_fields, strict=True)
            },
            "covariance": self.covariance.tolist() if self.covariance.any() else None,
            "sigma0_px": self.sigma0_px,
            "glass": None if self.glass is None else dict(self.glass),
            "details": dict(self.details),
        }

    def check_fits(self, columns: int, lines: int, glass: Mapping[str, float] | None) -> None:
        """Check that pictures of this size, taken through this glass, may be measured with it.

        Raises:
            CalibrationMismatch: They may not; the message says what differs.
        """
        if (columns, lines) != (self.columns, self.lines):
            raise CalibrationMismatch(
                f"calibration {self.id} is for pictures of {self.columns} x {self.lines}, "
                f"these are {columns} x {lines}",
                "choose a calibration made with this grabber and size, or calibrate again",
            )
        if not _same_glass(self.glass, glass):
            raise CalibrationMismatch(
                f"calibration {self.id} was made {_through(self.glass)}, "
                f"but the rig is set up {_through(glass)}",
                "the plate shifts the picture by a millimetre: calibrate with the glass that is in place",
            )


def _check_schema(reading: Reading, document: Mapping[str, Any]) -> None:
    if document.get("schema") != SCHEMA:
        reading.refuse("schema", document.get("schema"), repr(SCHEMA))
    reading.keys("", document, _KEYS)


def _time(reading: Reading, document: Mapping[str, Any]) -> str:
    text = reading.text(document, "created_utc")
    try:
        # A missing text has been refused already; one problem is enough.
        datetime.fromisoformat(text or "2000-01-01")
    except ValueError:
        reading.refuse("created_utc", text, "a time in ISO 8601")
    return text


def _view(reading: Reading, views: Mapping[str, object], name: str) -> View:
    where = f"views.{name}."
    values = reading.mapping(views, name, "views.")
    reading.keys(where, values, (*_EXTENT, *PARAMETERS[:9], "b", "polynomial", "local_field"))
    numbers = {key: reading.number(values, key, where, positive=key == "f_mm") for key in PARAMETERS[:9]}
    handedness = reading.integer(values, "handedness", where)
    if values.get("handedness") is not None and handedness not in {-1, 1}:
        reading.refuse(where + "handedness", handedness, "1 or -1")
    return View(
        name=name,
        first_column=reading.integer(values, "first_column", where, least=0, most=LARGEST_SIDE_PX),
        end_column=reading.integer(values, "end_column", where, least=1, most=LARGEST_SIDE_PX),
        pixel_x_mm=reading.number(values, "pixel_x_mm", where, positive=True),
        pixel_y_mm=reading.number(values, "pixel_y_mm", where, positive=True),
        handedness=handedness,
        b=tuple(reading.numbers(values.get("b"), where + "b", (9,)).tolist()),
        polynomial=_polynomial(reading, where, values.get("polynomial")),
        **numbers,
    )


def _polynomial(reading: Reading, where: str, value: object) -> Polynomial:
    for known in _POLYNOMIALS:
        if value == known:
            return known
    if value is not None:
        reading.refuse(where + "polynomial", value, " or ".join(map(repr, _POLYNOMIALS)))
    return _POLYNOMIALS[0]


def _view_document(view: View, local_field: LocalField | None) -> dict[str, Any]:
    numbers = {key: getattr(view, key) for key in (*_EXTENT, *PARAMETERS[:9])}
    beyond = None if local_field is None else local_field.to_document()
    # Not stated where it is as ever, so that earlier versions read the document.
    meaning = {} if view.polynomial == _POLYNOMIALS[0] else {"polynomial": view.polynomial}
    return {**numbers, "b": list(view.b), **meaning, "local_field": beyond}


def _local_field(reading: Reading, views: Mapping[str, Any], name: str) -> LocalField | None:
    view = views.get(name)
    if not isinstance(view, Mapping) or view.get("local_field") is None:
        return None
    where = f"views.{name}."
    values = reading.mapping(view, "local_field", where)
    return LocalField.from_document(reading, where + "local_field.", values) if values else None


def image_model(correlation: tuple[float, float]) -> dict[str, Any]:
    """Make the details of a calibration made of the centres of discs, with its local fields' correlation."""
    return {_IMAGES: {_CENTRES: True, _CORRELATION: list(correlation)}}


def _details(reading: Reading, document: Mapping[str, Any]) -> Mapping[str, Any]:
    details = reading.mapping(document, "details") if document.get("details") is not None else {}
    if details.get(_IMAGES) is None:
        return details
    where = f"details.{_IMAGES}."
    model = reading.mapping(details, _IMAGES, "details.")
    reading.keys(where, model, (_CENTRES, _CORRELATION))
    centres = model.get(_CENTRES, False)
    if not isinstance(centres, bool):
        reading.refuse(where + _CENTRES, centres, "true or false")
    x, y = reading.numbers(model.get(_CORRELATION, [0.0, 0.0]), where + _CORRELATION, (2,)).tolist()
    if max(abs(x), abs(y)) >= 1.0:
        reading.problems.append(f"{where}{_CORRELATION}: a correlation is not between -1 and 1")
    return details


def _covariance(reading: Reading, value: object) -> Array:
    if value is None:
        return np.zeros((_SIZE, _SIZE))
    covariance = reading.numbers(value, "covariance", (_SIZE, _SIZE))
    # Judged as correlations, because the parameters' units span twenty decades.
    sigma = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    scale = np.where(sigma > 0, sigma, 1.0)
    with np.errstate(over="ignore"):
        correlation = covariance / scale[:, np.newaxis] / scale
    if not np.isfinite(correlation).all():
        reading.problems.append(
            "covariance: has an entry far beyond its variances, so it is not a covariance"
        )
    elif np.abs(correlation - correlation.T).max() > _ROUNDING:
        reading.problems.append("covariance: is not symmetric")
    elif np.linalg.eigvalsh(correlation)[0] < -_ROUNDING:
        reading.problems.append("covariance: has a negative eigenvalue, so it is not a covariance")
    return (covariance + covariance.T) / 2


def _glass(reading: Reading, document: Mapping[str, Any]) -> dict[str, float] | None:
    if document.get("glass") is None:
        return None
    glass = reading.mapping(document, "glass")
    reading.keys("glass.", glass, _GLASS)
    return {key: reading.number(glass, key, "glass.", positive=True) for key in _GLASS}


def _check_halves(reading: Reading, calibration: Calibration) -> None:
    """Check that each half lies inside the picture, left before right; skipped while values are invalid."""
    left, right = calibration.views
    if reading.problems:
        return
    for view in calibration.views:
        if not view.first_column < view.end_column <= calibration.columns:
            where = f"views.{view.name}: columns {view.first_column} to {view.end_column}"
            reading.problems.append(f"{where} do not lie inside the picture's {calibration.columns}")
    if left.end_column > right.first_column:
        where = f"views: left ends at column {left.end_column}"
        reading.problems.append(f"{where}, right begins at {right.first_column}: they overlap or are swapped")


def _same_glass(mine: Mapping[str, float] | None, other: Mapping[str, float] | None) -> bool:
    if mine is None or other is None:
        return mine is other
    values = [(mine[key], other.get(key)) for key in _GLASS]
    return all(is_number(theirs) and abs(ours - theirs) <= 1e-6 for ours, theirs in values)


def _through(glass: Mapping[str, float] | None) -> str:
    if glass is None:
        return "without glass"
    return f"through {glass.get('thickness_mm')} mm of glass of index {glass.get('refractive_index')}"
