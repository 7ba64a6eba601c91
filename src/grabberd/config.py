"""The configuration: what stands in the YAML file, checked as a whole before anything starts.

All problems are found at once and named by file and key. Relative paths count from the file's own folder.
"""

import difflib
import os
import sys
from collections.abc import Hashable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    ValidationError,
    ValidationInfo,
    model_validator,
)
from pydantic_core import ErrorDetails

from grabberd.errors import ConfigError, Problem

BitDepth = Literal[1, 2, 3, 4, 5, 6, 8]
Lines = Literal["doubled", "field"]
OnInterruption = Literal["continue", "end"]
DeviceName = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")]

Millimetres = Annotated[float, Field(allow_inf_nan=False)]


def _existing_file(path: Path, info: ValidationInfo) -> Path:
    directory: Path = (info.context or {}).get("directory", Path())
    resolved = (directory / path.expanduser()).resolve()
    if not resolved.is_file():
        raise ValueError(f"no file {resolved}")
    return resolved


ExistingFile = Annotated[Path, AfterValidator(_existing_file)]


class Section(BaseModel):
    """A part of the configuration: unknown keys are refused, nothing changes after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ViewColumns(Section):
    """The columns of the picture that one view has."""

    first_column: int = Field(ge=0)
    end_column: int = Field(gt=0)


class Views(Section):
    """Both halves of the picture."""

    left: ViewColumns = ViewColumns(first_column=0, end_column=360)
    right: ViewColumns = ViewColumns(first_column=360, end_column=720)

    @model_validator(mode="after")
    def _stand_side_by_side(self) -> Self:
        for name, view in (("left", self.left), ("right", self.right)):
            if view.end_column <= view.first_column:
                raise ValueError(f"{name} has no columns: {view.first_column} to {view.end_column}")
        if self.left.end_column > self.right.first_column:
            raise ValueError(
                f"the views overlap: left ends at column {self.left.end_column}, "
                f"right begins at {self.right.first_column}"
            )
        return self


class GlassConfig(Section):
    """A plane plate between the mirrors and the object."""

    thickness_mm: Millimetres = Field(gt=0, le=50)
    refractive_index: float = Field(ge=1, le=3)


class RigConfig(Section):
    """The rig as it was built, each number to about ten per cent: the prior knowledge for a calibration."""

    columns: int = Field(720, ge=16, le=4096)
    lines: int = Field(576, ge=16, le=4096, multiple_of=2)
    views: Views = Views()
    distance_mm: Millimetres = Field(240.0, ge=20, le=5000)
    base_mm: Millimetres = Field(128.0, ge=5, le=2000)
    convergence_deg: float = Field(30.0, ge=0, le=120)
    focal_length_mm: Millimetres = Field(8.0, ge=1, le=200)
    pixel_x_mm: Millimetres = Field(0.0086, ge=0.001, le=0.05)
    pixel_y_mm: Millimetres = Field(0.0083, ge=0.001, le=0.05)
    exposure_ms: float = Field(1.0, gt=0, le=20)
    glass: GlassConfig | None = Field(
        None, description="the plate that is in place; a calibration has to match it"
    )

    @model_validator(mode="after")
    def _views_inside_picture(self) -> Self:
        if self.views.right.end_column > self.columns:
            raise ValueError(
                f"the right view ends at column {self.views.right.end_column}, the picture has {self.columns}"
            )
        return self


class RingConfig(Section):
    """The ring of packed fields."""

    slots: int = Field(32, ge=4, le=4096)
    bits: BitDepth = 1
    lines: Lines | None = Field(None, description="doubled (default at 1 bit) or field (default for grey)")
    interpolation: Literal["linear", "kernel3x3"] = Field(
        "linear", description="of the missing lines of doubled fields, on the grey values"
    )


class ThresholdConfig(Section):
    """How the grey value is found that separates targets from the background."""

    kind: Literal["fixed", "trinder", "automatic"] = "automatic"
    value: int | None = Field(None, ge=0, le=254)
    map: bool = Field(False, description="a threshold for every pixel, for uneven light; automatic, 1 bit")

    @model_validator(mode="after")
    def _value_belongs_to_fixed(self) -> Self:
        if (self.kind == "fixed") != (self.value is not None):
            raise ValueError("'value' belongs to kind fixed, and kind fixed needs it")
        return self

    @model_validator(mode="after")
    def _map_belongs_to_automatic(self) -> Self:
        if self.map and self.kind != "automatic":
            raise ValueError(f"'map' belongs to kind automatic, not to {self.kind}")
        return self


class LocationConfig(Section):
    """How targets are located in the picture."""

    method: str = Field("automatic", description="a locator by name, or what measured best for the bits")
    target_px: float | None = Field(None, gt=0, le=100, description="size of the targets; default: as seen")
    line_shifts: bool | None = Field(None, description="solve for the lines' shifts; default: where it pays")


class CaptureConfig(Section):
    """What captures are like unless they are asked for otherwise."""

    on_interruption: OnInterruption = Field(
        "continue",
        description="when the device fails to deliver: continue with the gap in the ledger, or end",
    )


class DeviceConfig(Section):
    """One grabber, the rig before it and how its fields are treated."""

    driver: str
    options: dict[str, Any] = Field(default_factory=dict)
    rig: RigConfig = RigConfig()
    calibration: ExistingFile | None = None
    object: ExistingFile | None = None
    ring: RingConfig = RingConfig()
    threshold: ThresholdConfig = ThresholdConfig()
    location: LocationConfig = LocationConfig()
    capture: CaptureConfig = CaptureConfig()
    line_jitter_px: float = Field(0.12, ge=0, le=2)
    spread_px: float = Field(0.8, gt=0, le=5)

    @model_validator(mode="after")
    def _map_belongs_to_one_bit(self) -> Self:
        if self.threshold.map and self.ring.bits != 1:
            raise ValueError(f"threshold.map needs ring.bits: 1, not {self.ring.bits}")
        return self


class RetentionConfig(Section):
    """Which sealed captures are removed by themselves, the oldest first; without a key, none.

    Running, armed, pinned and damaged ones stay, and those that a job works on.
    """

    keep_days: float | None = Field(None, ge=1, le=36_500, description="older captures are removed")
    min_free_gb: float | None = Field(
        None, gt=0, le=100_000, description="while less is free, the oldest are removed"
    )


class StorageConfig(Section):
    """Where captures are kept, and for how long."""

    directory: Path | None = Field(None, description="default: the service's state directory")
    queue_s: float = Field(10.0, ge=1, le=600)
    reserve_gb: float = Field(
        0.2, ge=0.05, le=100_000, description="stays free: no capture begins or goes on beyond it"
    )
    retention: RetentionConfig = RetentionConfig()

    @model_validator(mode="after")
    def _retention_makes_room(self) -> Self:
        least = self.retention.min_free_gb
        if least is not None and least <= self.reserve_gb:
            raise ValueError(
                f"retention.min_free_gb {least:g} has to be more than reserve_gb {self.reserve_gb:g}"
            )
        return self


HostName = Annotated[
    str, StringConstraints(pattern=r"^([A-Za-z0-9._-]{1,253}|[0-9A-Fa-f:.]+)$", to_lower=True)
]


class TlsConfig(Section):
    """The certificate that the daemon shows, and its private key."""

    certificate: ExistingFile = Field(description="a PEM file, with the chain")
    key: ExistingFile = Field(description="a PEM file without a passphrase, readable for the daemon alone")


class HttpLimits(Section):
    """What one client can ask of the daemon."""

    body_bytes: int = Field(16_777_216, ge=1024, le=2**30, description="of a request")
    head_timeout_s: float = Field(10.0, gt=0, le=600, description="until a request's head has come")
    body_timeout_s: float = Field(30.0, gt=0, le=3600, description="until its body has come")
    write_timeout_s: float = Field(30.0, gt=0, le=3600, description="how long a client may read nothing")
    connections: int = Field(256, ge=4, le=10_000, description="of all clients together")
    streams_per_client: int = Field(8, ge=1, le=1000, description="live streams to one address")


class HttpConfig(Section):
    """Where the daemon listens, and by which names it is called."""

    host: str = Field("127.0.0.1", description="other than loopback only with tokens")
    port: int = Field(8050, ge=0, le=65535)
    hosts: tuple[HostName, ...] = Field((), description="further names and addresses that clients call it by")
    tls: TlsConfig | None = Field(None, description="without it, plain HTTP")
    limits: HttpLimits = HttpLimits()


class Config(Section):
    """The whole configuration."""

    site: dict[str, str] = Field(default_factory=dict)
    devices: dict[DeviceName, DeviceConfig] = Field(min_length=1)
    storage: StorageConfig = StorageConfig()
    http: HttpConfig = HttpConfig()

    @property
    def state_directory(self) -> Path:
        """The folder of captures, index and state."""
        return self.storage.directory or default_state_directory()


def default_state_directory() -> Path:
    """Systemd's state directory, else the user's own."""
    if systemd := os.environ.get("STATE_DIRECTORY"):
        return Path(systemd.split(":")[0])
    base = os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state"
    return Path(base) / "grabberd"


def shipped_configs() -> Path:
    """The folder of the configurations that come with the program: in a checkout, or as installed."""
    checkout = Path(__file__).resolve().parents[2] / "configs"
    return checkout if checkout.is_dir() else Path(sys.prefix) / "share" / "grabberd" / "configs"


def default_config_file() -> Path:
    """The configuration of the simulated grabber, in force where none is named."""
    return shipped_configs() / "fake.yaml"


def load_config(path: Path) -> Config:
    """The configuration in a YAML file.

    Raises:
        ConfigError: with every problem of it.
    """
    document = _read_yaml(path)
    try:
        return Config.model_validate(document, context={"directory": path.resolve().parent})
    except ValidationError as error:
        problems = [_problem(path, details) for details in error.errors()]
        raise ConfigError(problems) from None


def _read_yaml(path: Path) -> object:
    try:
        return yaml.load(path.read_text(encoding="utf-8"), Loader=_StrictLoader)  # noqa: S506 - it is a SafeLoader
    except OSError as error:
        raise ConfigError([Problem(str(path), "(file)", error.strerror or str(error))]) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError([Problem(str(path), "(file)", f"no YAML: {error}")]) from None


class _StrictLoader(yaml.SafeLoader):
    """Refuses a key that is given twice, where YAML would silently take the last."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        keys = [self.construct_object(key, deep=True) for key, _ in node.value]
        for key in keys:
            if keys.count(key) > 1:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key!r} is given twice", node.start_mark
                )
        return super().construct_mapping(node, deep)


def _problem(path: Path, details: ErrorDetails) -> Problem:
    key = ".".join(str(part) for part in details["loc"]) or "(file)"
    return Problem(str(path), key, _explain(details))


def _explain(details: ErrorDetails) -> str:
    key = str(details["loc"][-1]) if details["loc"] else ""
    if details["type"] == "extra_forbidden":
        return f"unknown key{_did_you_mean(key, details['loc'])}"
    message = details["msg"].removeprefix("Value error, ")
    if isinstance(details["input"], Mapping | list):
        return message
    return f"{message}, not {details['input']!r}{_unit_advice(key)}"


def _did_you_mean(key: str, location: tuple[int | str, ...]) -> str:
    known = sorted(_known_keys(location))
    near = [name for name in known if name.startswith(key + "_")] or difflib.get_close_matches(
        key, known, n=1
    )
    return f"; did you mean {near[0]}?" if near else f"; known here: {', '.join(known)}"


def _known_keys(location: tuple[int | str, ...]) -> set[str]:
    """The keys that the section at this place knows."""
    section: Any = Config
    for part in location[:-1]:
        section = _descend(section, part)
        if section is None:
            return set()
    return set(getattr(section, "model_fields", ()))


def _descend(section: Any, part: int | str) -> Any:
    if isinstance(section, type) and issubclass(section, BaseModel):
        found = section.model_fields.get(str(part))
        return found.annotation if found else None
    arguments = get_args(section)
    return arguments[-1] if arguments else None


UNITS = {"_mm": "millimetres", "_px": "pixels", "_ms": "milliseconds", "_s": "seconds", "_deg": "degrees"}


def _unit_advice(key: str) -> str:
    unit = next((name for suffix, name in UNITS.items() if key.endswith(suffix)), None)
    return f" (this key is in {unit})" if unit else ""
