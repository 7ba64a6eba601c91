"""Scripts of the Damped Bundle Adjustment Toolbox (DBAT): a network, and which of its parameters are free.

An XML document names lists of images, image points and control points, states one camera, and says what is
adjusted. Read is what the adjustment here repeats to the last digit: control points as datum, one camera of
DBAT's default model (a correction of observed points), poses and object points free. All else is refused.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from xml.parsers import expat

import numpy as np

from grabberd.core.calibration.adjustment.network import LENS, Network, Unknowns
from grabberd.core.calibration.adjustment.starting_values import POSE
from grabberd.core.calibration.control_points import ControlPoint, Lines, read_control_points
from grabberd.core.geometry import View
from grabberd.errors import InputError

_WHAT = "the DBAT script"
_MOST_CHARACTERS, _MOST_ELEMENTS, _DEEPEST, _MOST_IMAGES = 1 << 24, 10_000, 40, 10_000
_READ = "read are scripts that adjust images with control points and one camera, as DBAT's own sxb.xml"
_LENS = {"cc": LENS[:1], "pp": LENS[1:3], "K": LENS[3:6], "P": LENS[6:8]}
_NEUTRAL = {"skew": "0", "aspect": "1"}
_WITHOUT_EFFECT = {"spatial_resection", "forward_intersection", "bundle_adjustment", "set_initial_values"}
_SQUARE = 1e-4
"""Share by which the sides of a pixel may differ, as sensors are stated."""
_UNKNOWN = ControlPoint((0.0, 0.0, 0.0), (np.inf,) * 3)
_SIGMAS = {"sxyz": "sigma", "sxy": "sigma_xy", "sx": "sigma_x", "sy": "sigma_y", "sz": "sigma_z"}


@dataclass(slots=True)
class _Element:
    """An element of the document, without comments."""

    name: str
    attributes: Mapping[str, str]
    parts: list["_Element"] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        return "".join(self.texts).strip()

    def all(self, name: str) -> list["_Element"]:
        return [part for part in self.parts if part.name == name]

    def find(self, name: str) -> "_Element | None":
        """The part of a name, which must not stand twice."""
        found = self.all(name)
        if len(found) > 1:
            raise _refusal(f"<{self.name}> has {len(found)} parts <{name}>", "keep one")
        return found[0] if found else None

    def one(self, name: str) -> "_Element":
        if (found := self.find(name)) is None:
            raise _refusal(f"<{self.name}> has no <{name}>")
        return found

    def numbers(self, name: str, count: int, otherwise: str = "") -> list[float]:
        """The numbers between commas of a part, or of what stands for it where there is none."""
        part = self.find(name)
        words = (part.text if part else otherwise).split(",")
        return Lines("", f"<{name}> of {_WHAT}").as_numbers([word.strip() for word in words], count, count)


def _refusal(why: str, hint: str = _READ) -> InputError:
    return InputError(f"{_WHAT}: {why}", hint)


def read_dbat_script(text: str, read_file: Callable[[str], str]) -> tuple[Network, Unknowns]:
    """Read a network and its unknowns; the poses and the positions of object points are still to be found.

    Pixels and principal points keep the origin of the file; lengths are in m there and in mm here.

    Args:
        text: The script.
        read_file: Gives the text of a file that the script names, by its path from the script's folder.

    Raises:
        InputError: The script or a list is no such document, names a file outside of its folder, or asks for
            what is not read; the message says what.
    """
    script = _parsed(text)
    if script.name != "document" or "dbat_script_version" not in script.attributes:
        raise _refusal("this is no script of DBAT")
    _check_unit(script)
    given = script.one("input")
    if given.find("prior_eo"):
        raise _refusal("prior orientations of images are not read: no observation stands for them here")
    base = given.attributes.get("base_dir", "$HERE")
    least, loaded, adjusted = _operations(script.one("operations"))
    camera = _camera(given.one("cameras").one("camera"), loaded, adjusted)
    loose = tuple(one for name, those in _LENS.items() if adjusted.get(name) for one in those)
    images = _images(_Rows(given.one("images").one("file"), base, read_file))
    views = tuple(replace(camera, name=name) for name in images.values())
    network = _network(views, _marks(given.one("image_pts"), images, base, read_file),
                       _control(given.find("ctrl_pts"), base, read_file), least)  # fmt: skip
    return network, Unknowns.of(views, (*loose, *POSE), shared=loose)


def _parsed(text: str) -> _Element:
    """The document; one that declares a type or entities is refused, as are large and deep ones."""
    top = _Element("", {})
    opened, count = [top], 0

    def begin(name: str, attributes: dict[str, str]) -> None:
        nonlocal count
        count += 1
        if count > _MOST_ELEMENTS or len(opened) > _DEEPEST:
            raise _refusal(f"it has more than {_MOST_ELEMENTS} elements, or more than {_DEEPEST} levels")
        opened[-1].parts.append(_Element(name, attributes))
        opened.append(opened[-1].parts[-1])

    def letters(characters: str) -> None:
        opened[-1].texts.append(characters)

    def declare(*_: object) -> None:
        raise _refusal("it declares a document type", "remove the line <!DOCTYPE …>: entities are not read")

    parser = expat.ParserCreate()
    parser.StartElementHandler = begin
    parser.EndElementHandler = lambda _: opened.pop()
    parser.CharacterDataHandler = letters
    parser.StartDoctypeDeclHandler = declare
    try:
        parser.Parse(_bounded(text, _WHAT).encode(), True)
    except expat.ExpatError as error:
        raise _refusal(f"line {error.lineno}: {expat.ErrorString(error.code)}", "correct the XML") from None
    return top.parts[0]


def _bounded(text: str, what: str) -> str:
    if len(text) > _MOST_CHARACTERS:
        raise InputError(f"{what} has more than {_MOST_CHARACTERS} characters", _READ)
    return text


def _check_unit(script: _Element) -> None:
    meta = script.find("meta")
    unit = meta.find("project_unit") if meta else None
    if unit and unit.text != "m":
        raise _refusal(f"its unit is {unit.text[:20]!r}", "state control points and <project_unit> in m")


def _operations(operations: _Element) -> tuple[int, bool, Mapping[str, bool]]:
    """Least number of images of an object point, whether the camera starts as it states, what is adjusted."""
    least, loaded, adjusted = 0, True, dict[str, bool]()
    for operation in operations.all("operation"):
        part = operation.parts[0] if operation.parts else operation
        name = part.name if operation.parts else operation.text
        if name == "check_ray_count":
            words = [operation.attributes.get("min_rays", "2")]
            least = int(Lines("", f"min_rays of {_WHAT}").as_numbers(words, 1)[0])
        elif name == "set_initial_values" and (io := part.find("io")):
            loaded = _word(io.find("all") or io) != "default"
        elif name == "set_bundle_estimate_params":
            adjusted = dict(_estimated(part))
        elif name not in _WITHOUT_EFFECT:
            raise _refusal(f"the operation {name[:40]!r} is not read")
    return least, loaded, adjusted


def _estimated(params: _Element) -> Mapping[str, bool]:
    """Parameters of the camera that are adjusted; all poses and all object points have to be."""
    for kind, words in (("eo", {"true"}), ("op", {"true", "default"})):
        given = params.find(kind)
        if given and not {_word(one) for one in given.parts or [given]} <= words:
            raise _refusal(f"<{kind}> holds some of the poses or object points", "estimate all of them")
    io = params.find("io")
    if not io:
        return {}
    if not io.parts:
        return dict.fromkeys((*_LENS, *_NEUTRAL), _word(io) == "true")
    every = io.find("all")
    chosen = dict.fromkeys((*_LENS, *_NEUTRAL), bool(every) and _word(io.one("all")) == "true")
    for part in io.parts:
        if part.name in chosen:
            chosen[part.name] = _word(part) == "true"
        elif part.name != "all":
            raise _refusal(f"<{part.name}> of <io> is not read", f"known are {', '.join(chosen)}")
    return chosen


def _word(element: _Element) -> str:
    return element.text.lower()


def _camera(one: _Element, loaded: bool, adjusted: Mapping[str, bool]) -> View:
    """The camera as a view without a pose."""
    for name, neutral in _NEUTRAL.items():
        if adjusted.get(name) or one.numbers(name, 1, neutral) != [float(neutral)]:
            raise _refusal(f"the camera's {name} is not {neutral}, or adjusted", f"hold it at {neutral}")
    if one.numbers("model", 1) not in ([1.0], [3.0]):
        raise _refusal(f"the camera has model {one.one('model').text[:20]!r}", "read are models 1 and 3")
    if (unit := one.find("unit")) and _word(unit) != "mm":
        raise _refusal("the camera's unit is not mm", "state it in mm")
    columns, lines = one.numbers("image", 2)
    height = one.numbers("sensor", 2) if "auto" not in one.one("sensor").text else [0.0, _auto(one)]
    if min(columns, lines, height[1]) <= 0 or max(columns, lines) != int(max(columns, lines)):
        raise _refusal("the camera's image or sensor has no size", "state pixels, and mm")
    pixel_mm = height[1] / lines
    if height[0] and abs(height[0] / columns / pixel_mm - 1.0) > _SQUARE:
        raise _refusal("the camera's pixels are not square", "state a sensor that fits the image")
    focal, middle = one.one("focal").text, f"{columns * pixel_mm / 2},{lines * pixel_mm / 2}"
    stated = one if loaded else _Element("camera", {})
    x_mm, y_mm = stated.numbers("pp", 2, middle)
    if any(stated.numbers("P", 2, "0,0")):
        raise _refusal("the camera states a decentering distortion <P>", "start from 0,0")
    return View(
        name="",
        first_column=0,
        end_column=int(columns),
        pixel_x_mm=pixel_mm,
        pixel_y_mm=pixel_mm,
        handedness=1,
        f_mm=stated.numbers("cc", 1, focal)[0],
        x0_px=x_mm / pixel_mm,
        y0_px=y_mm / pixel_mm,
        **dict.fromkeys(POSE, 0.0),
        b=(0.0, 0.0, *stated.numbers("K", 3, "0,0,0"), 0.0, 0.0, 0.0, 0.0),
        polynomial="correction",
    )


def _auto(camera: _Element) -> float:
    """Height of a sensor whose width follows from it."""
    words = camera.one("sensor").text.split(",")
    return Lines("", f"<sensor> of {_WHAT}").as_numbers(words[1:], 1, 1)[0]


class _Rows:
    """Rows of a list that the script names, each with its columns' names."""

    def __init__(self, file: _Element, base: str, read_file: Callable[[str], str]) -> None:
        base = base.strip().rstrip("/")
        parts = file.text.replace("\\", "/").split("/")
        if base != "$HERE" or set("$:") & set(file.text) or not all(part.strip(". ") for part in parts):
            why = f"{file.text[:60]!r} under {base[:60]!r} is not in the script's own folder"
            raise _refusal(why, "put all lists beside the script, with base_dir $HERE")
        self.columns = [one.strip().lower() for one in file.attributes.get("format", "").split(",")]
        self.lines = Lines(_bounded(read_file(file.text), file.text), file.text)

    def __iter__(self) -> Iterator[dict[str, str]]:
        for line in self.lines.rest():
            cells = [cell.strip() for cell in line.split(",")]
            if len(cells) != len(self.columns):
                raise self.lines.refusal(f"{len(cells)} cells, and the script names {len(self.columns)}")
            yield dict(zip(self.columns, cells, strict=True))

    def number(self, row: Mapping[str, str], name: str, otherwise: str = "") -> float:
        """The number in a column."""
        return self.lines.as_numbers([row.get(name, otherwise)], 1)[0]

    def id(self, row: Mapping[str, str], name: str) -> int:
        """The id in a column."""
        return self.lines.whole(self.number(row, name), name)


def _stem(path: str) -> str:
    """Name of a file without folder and ending."""
    name = path.replace("\\", "/").rpartition("/")[2]
    return name.rpartition(".")[0] or name


def _images(rows: _Rows) -> dict[int, str]:
    """Names of the images by their ids, in their order."""
    images, seen = dict[int, str](), dict[int, int]()
    for row in rows:
        name = _stem(row.get("path", "")) or f"image {len(images) + 1}"
        number = rows.lines.new(rows.number(row, "id"), "image", seen)
        images[number] = name if name not in images.values() else f"{name} ({number})"
        if len(images) > _MOST_IMAGES:
            raise rows.lines.refusal(f"there are more than {_MOST_IMAGES} images", _READ)
    return images


def _marks(
    given: _Element, images: Mapping[int, str], base: str, read_file: Callable[[str], str]
) -> dict[tuple[int, int], tuple[float, float, float, float]]:
    """x, y and their σ in px of each image point, by the place of its image and its id."""
    place = {number: index for index, number in enumerate(images)}
    marks = dict[tuple[int, int], tuple[float, float, float, float]]()
    for file in given.all("file"):
        rows, of_all = _Rows(file, base, read_file), file.attributes.get("sxy", "")
        for row in rows:
            image, point = rows.id(row, "im"), rows.id(row, "id")
            if image not in place or (place[image], point) in marks:
                why = "is not listed" if image not in place else f"shows point {point} already"
                raise rows.lines.refusal(f"image {image} {why}", "correct the list")
            both = row.get("sxy", "")
            sigma = [rows.number({name: of_all or both or row.get(name, "")}, name) for name in ("sx", "sy")]
            if min(sigma) <= 0:
                raise rows.lines.refusal("a standard deviation of an image point is not above 0", _READ)
            marks[place[image], point] = rows.number(row, "x"), rows.number(row, "y"), sigma[0], sigma[1]
    return marks


def _control(
    given: _Element | None, base: str, read_file: Callable[[str], str]
) -> Mapping[int, ControlPoint]:
    """Control points by id, of those that the filters leave."""
    if given is None:
        raise _refusal("there are no control points: a datum by fixed images (<set_datum>) is not read")
    rows = _Rows(given.one("file"), base, read_file)
    header = ", ".join(_SIGMAS.get(name, name) for name in rows.columns)
    points: Mapping[int, ControlPoint] = read_control_points(rows.lines.with_header(f"# {header} (m)"))
    for one in given.all("filter"):
        words = [word.strip() for word in one.attributes.get("id", "").split(",")]
        ids, kept = set(Lines("", f"<filter> of {_WHAT}").as_numbers(words, 1)), _word(one) == "keep"
        if _word(one) not in ("keep", "remove"):
            raise _refusal(f"the filter {one.text[:20]!r} is neither keep nor remove")
        points = {number: point for number, point in points.items() if (number in ids) == kept}
    return points


def _network(
    views: tuple[View, ...],
    marks: Mapping[tuple[int, int], tuple[float, float, float, float]],
    control: Mapping[int, ControlPoint],
    least: int,
) -> Network:
    """Network of the points that enough images show."""
    seen, times = np.unique([point for _, point in marks], return_counts=True)
    ids = seen[(times >= least) | np.isin(seen, list(control))].astype(np.int32)
    kept = [(*key, *mark) for key, mark in marks.items() if key[1] in set(ids.tolist())]
    values = np.array(kept, np.float64).reshape(-1, 6)
    places = [control.get(number, _UNKNOWN) for number in ids.tolist()]
    return Network(
        views=views,
        view=values[:, 0].astype(np.intp),
        target=np.searchsorted(ids, values[:, 1]),
        xy_px=values[:, 2:4],
        sigma_px=values[:, 4:],
        target_mm=np.array([point.xyz_mm for point in places]),
        target_sigma_mm=np.array([point.sigma_mm for point in places]),
        ids=ids,
        among_corrected=True,
    )
