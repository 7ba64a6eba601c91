"""Schema of a calibration, which `core.geometry.calibration` reads key by key."""

from grabberd.core.geometry.calibration import LARGEST_SIDE_PX, SCHEMA
from grabberd.core.geometry.view import PARAMETERS
from grabberd.schemas.forms import (
    Schema,
    either,
    integer,
    mapping,
    number,
    numbers,
    one_of,
    or_nothing,
    positive,
    text,
)

_NODES = 4
"""Least number of nodes of a local field, in each direction."""
_MEANINGS = {
    "f_mm": "Principal distance.",
    "x0_px": "Principal point: column.",
    "y0_px": "Principal point: frame line.",
    "omega_rad": "R = Rκ · Rφ · Rω.",
    "X0_mm": "Projection centre in the object's frame.",
}


def calibration_schema() -> Schema:
    """The schema of a calibration's document."""
    side = integer(least=1, most=LARGEST_SIDE_PX)
    size = 2 * len(PARAMETERS)
    keys = {
        "schema": {"const": SCHEMA},
        "id": text("Name of this calibration."),
        "created_utc": {**text("Time of creation, ISO 8601."), "format": "date-time"},
        "source": text("Its origin, for people."),
        "image": mapping({"columns": side, "lines": side}, ("columns", "lines"), "Size of the pictures."),
        "views": mapping({"left": _view(), "right": _view()}, ("left", "right")),
        "covariance": or_nothing(
            numbers(size, size),
            "Of the left, then the right view's parameters in the order f_mm … b9; 0 where one was held.",
        ),
        "sigma0_px": or_nothing(number(), "Standard deviation of unit weight; null if nothing was adjusted."),
        "glass": or_nothing(
            mapping(
                {"thickness_mm": positive(), "refractive_index": positive()},
                ("thickness_mm", "refractive_index"),
            ),
            "The plate that was in place.",
        ),
        "details": or_nothing(
            {"type": "object"}, "Certificate, temperature, protocol: carried along unread."
        ),
    }
    required = ("schema", "id", "created_utc", "source", "image", "views")
    return mapping(keys, required)


def _view() -> Schema:
    keys = {
        "first_column": integer("First column of its half.", least=0, most=LARGEST_SIDE_PX),
        "end_column": integer("Column after its last.", least=1, most=LARGEST_SIDE_PX),
        "pixel_x_mm": positive("Width of a pixel."),
        "pixel_y_mm": positive("Height of a frame line."),
        "handedness": one_of(1, -1, description="-1 where light is reflected an odd number of times."),
    }
    outer = PARAMETERS[:9]
    keys |= {key: number(_MEANINGS.get(key, "")) for key in outer}
    keys["f_mm"] = positive(_MEANINGS["f_mm"])
    keys["b"] = numbers(9, description="b1 … b9 of the distortion.")
    required = tuple(keys)
    keys["polynomial"] = one_of(
        "distortion", "correction", None, description="Whether b is added to the ideal or the observed point."
    )
    keys["local_field"] = either(_local_field(), {"type": "null"}, mapping({}))
    return mapping(keys, required)


def _local_field() -> Schema:
    keys = {"origin_px": numbers(2), "step_px": positive(), "x_px": _grid(), "y_px": _grid()}
    keys |= {"sigma_x_px": _grid(least=0), "sigma_y_px": _grid(least=0)}
    return mapping(keys, tuple(keys), "What the picture shows beyond the model, a spline on a grid of nodes.")


def _grid(*, least: float | None = None) -> Schema:
    value = number() if least is None else number(minimum=least)
    row = {"type": "array", "items": value, "minItems": _NODES}
    return {"type": "array", "items": row, "minItems": _NODES}
