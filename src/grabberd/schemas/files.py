"""Schemas of the program's own files: configuration, capture, object, calibration frame, calibration.

Those of files that models read are the models' own. Objects and calibration frames have theirs from the
tables of keys that their readers have; a calibration is read key by key, by `core.geometry.calibration`.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from grabberd.archive.calibrations.calibration_catalog import CALIBRATION_FRAME_KEYS
from grabberd.archive.capture.meta import StoredMeta
from grabberd.config import Config
from grabberd.core.field import BIT_DEPTHS
from grabberd.core.geometry.calibration import LARGEST_SIDE_PX, SCHEMA
from grabberd.core.geometry.view import PARAMETERS
from grabberd.core.reconstruction.object_model import KEYS, TARGET_KEYS, FileKey
from grabberd.documents.requests import CertifiedLength

Schema = dict[str, Any]

LARGEST_INTEGER = (1 << 31) - 1
"""Whole numbers that a reader takes where nothing else limits them."""


class Form(NamedTuple):
    """The form of a file.

    Attributes:
        title: What the file is.
        made: Makes its schema.
    """

    title: str
    made: Callable[[], Schema]


def text(description: str = "") -> Schema:
    """A text that is not empty."""
    return _described({"type": "string", "minLength": 1}, description)


def number(description: str = "", **limits: float) -> Schema:
    """A number, within `minimum`, `exclusiveMinimum` and the like."""
    return _described({"type": "number", **limits}, description)


def positive(description: str = "") -> Schema:
    """A number above 0."""
    return number(description, exclusiveMinimum=0)


def integer(description: str = "", *, least: int = -LARGEST_INTEGER, most: int = LARGEST_INTEGER) -> Schema:
    """A whole number."""
    return _described({"type": "integer", "minimum": least, "maximum": most}, description)


def one_of(*values: object, description: str = "") -> Schema:
    """One of some values."""
    return _described({"enum": list(values)}, description)


def numbers(*shape: int, description: str = "") -> Schema:
    """Nested lists of numbers of this shape."""
    inner: Schema = {"type": "number"}
    for length in reversed(shape):
        inner = {"type": "array", "items": inner, "minItems": length, "maxItems": length}
    return _described(inner, description)


def mapping(keys: Mapping[str, Schema], required: tuple[str, ...] = (), description: str = "") -> Schema:
    """A mapping that has no other keys than these."""
    form: Schema = {"type": "object", "properties": dict(keys), "additionalProperties": False}
    if required:
        form["required"] = list(required)
    return _described(form, description)


def either(*forms: Schema, description: str = "") -> Schema:
    """One form or another."""
    return _described({"anyOf": list(forms)}, description)


def or_nothing(form: Schema, description: str = "") -> Schema:
    """The form, or null, which stands for a key that is left out."""
    return either(form, {"type": "null"}, description=description)


def _described(form: Schema, description: str) -> Schema:
    return form | ({"description": description} if description else {})


def configuration_schema() -> Schema:
    """The schema of the configuration."""
    schema = Config.model_json_schema()
    for name in ("devices", "loggers"):
        # The model leaves it open what other names than those of the pattern are.
        schema["properties"][name]["additionalProperties"] = False
    schema["$defs"]["LoggerConfig"]["properties"]["channels"]["additionalProperties"] = False
    return schema


def capture_meta_schema() -> Schema:
    """The schema of a capture's metadata; a later version may have further keys."""
    schema = StoredMeta.model_json_schema()
    schema["properties"]["bits"] = {"title": "Bits", "enum": list(BIT_DEPTHS)}
    return schema


_KINDS: Mapping[str, Callable[[], Schema]] = {
    "text": text,
    "number": number,
    "number above 0": positive,
    "number from 0": lambda: number(minimum=0),
    "whole number": integer,
    "whole number from 0": lambda: integer(least=0),
    "three numbers": lambda: numbers(3),
    "`true` or `false`": lambda: {"type": "boolean"},
    "list": lambda: {"type": "array", "minItems": 1, "items": _keys(TARGET_KEYS)},
    "anything": dict,
    "mapping": CertifiedLength.model_json_schema,
}
"""Schemas of the kinds of values that the tables of keys name."""


def object_schema() -> Schema:
    """The schema of an object's file."""
    return _keys(KEYS)


def calibration_frame_schema() -> Schema:
    """The schema of a calibration frame's file."""
    return _keys({**KEYS, **CALIBRATION_FRAME_KEYS})


def _keys(keys: Mapping[str, FileKey]) -> Schema:
    required = tuple(name for name, key in keys.items() if key.default is None)
    return mapping({name: _key(key) for name, key in keys.items()}, required)


def _key(key: FileKey) -> Schema:
    unit = f" [{key.unit}]" if key.unit else ""
    return {**_KINDS[key.kind](), "description": f"{key.meaning}{unit}"}


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
            {"type": "object", "properties": {"image_model": or_nothing(_image_model())}},
            "Certificate, temperature, protocol: carried along unread, but for image_model.",
        ),
    }
    required = ("schema", "id", "created_utc", "source", "image", "views")
    return mapping(keys, required)


def _image_model() -> Schema:
    own = {"type": "number", "exclusiveMinimum": -1, "exclusiveMaximum": 1}
    keys: dict[str, Schema] = {
        "disc_centres": {
            "type": "boolean",
            "description": "Whether it was made of the centres of discs, not of their pictures' middles.",
        },
        "local_correlation": {
            "type": "array",
            "items": own,
            "minItems": 2,
            "maxItems": 2,
            "description": "Of the errors left in both local fields, in x and in y.",
        },
    }
    return mapping(keys, (), "What the images were taken for.")


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
