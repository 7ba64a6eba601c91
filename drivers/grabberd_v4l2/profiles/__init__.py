"""Profiles of kernel drivers, each a YAML file, built in or provided by the installer."""

from collections.abc import Iterable, Mapping
from enum import StrEnum
from functools import cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from grabberd.bounded_documents import as_written, parse_yaml, read_text
from grabberd.core.field import PARITIES
from grabberd.errors import said
from grabberd.instrument.acquisition.device import Verdict
from grabberd_v4l2.abi import Arrangement

__all__ = ["DEFAULT", "DIRECTORY", "Profile", "Profiles", "SignalSource"]


DIRECTORY = Path("/etc/grabberd/profiles.d")
"""Directory of the installer's own profiles."""
DEFAULT = "default"
"""Profile of unknown drivers."""


class SignalSource(StrEnum):
    """Query by which a driver reports a missing camera."""

    ENUMINPUT = "enuminput"
    QUERYSTD = "querystd"
    NONE = "none"


class Profile(BaseModel):
    """Profile of a kernel driver; its fields are the keys of its file.

    Attributes:
        driver: Name of the driver in VIDIOC_QUERYCAP, and name of the file; followed by " VID:PID" if the
            profile applies only to that device.
        also: Other names of the driver.
        older: "top" or "bottom": the field of a woven frame that was exposed first, for any standard; by
            default as defined by V4L2, top at 50 Hz and bottom at 60 Hz.
        field_orders: Arrangements to request, the best first; others are never requested.
        none_is_woven: True if the driver reports NONE for frames woven from two fields.
        trusts_sequence: True if the driver's count grows when a field is lost.
        trusts_time: True if the driver timestamps buffers at the end of their last field.
        time_sigma_ms: Standard deviation of the timestamps.
        flags_gaps_alone: True if a flagged picture lacks parts, and nothing else is wrong with it.
        after_gap: "older" or "both": fields of the first woven frame after a gap that may be of the frame
            before, since the driver did not see where that ended.
        starts_again: False if the driver must not be started again after a start that failed, nor the
            buffers of that start be freed, before the device has been reset or replugged.
        signal_source: Query that reports a missing camera.
        verdict: Verdict on the driver.
        remarks: Reasons for the verdict, as sentences.
        advice: Advice if the driver is not good enough.
        usb_ids: "VID:PID" of devices that it supports.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    _as_written = field_validator("*", mode="wrap")(as_written)

    driver: str = Field(min_length=1)
    also: tuple[str, ...] = ()
    # Needed by usbtv, whose frames are bottom field first even at 50 Hz without reporting it.
    older: Literal["top", "bottom"] | None = None
    field_orders: tuple[Arrangement, ...] = Field(min_length=1)
    none_is_woven: bool = False
    # Most drivers do not count lost fields, so by default losses are detected by gaps in time.
    trusts_sequence: bool = False
    trusts_time: bool = True
    time_sigma_ms: float = Field(3.0, gt=0, le=40)
    flags_gaps_alone: bool = False
    after_gap: Literal["older", "both"] | None = None
    starts_again: bool = True
    signal_source: SignalSource = SignalSource.NONE
    verdict: Verdict = Verdict.USABLE
    remarks: tuple[str, ...] = ()
    advice: str = ""
    usb_ids: tuple[str, ...] = ()

    @property
    def older_parity(self) -> int | None:
        """`TOP` or `BOTTOM`: the older field of a woven frame; None: as defined by the standard."""
        return None if self.older is None else PARITIES[self.older]

    @property
    def old_after_gap(self) -> tuple[int, ...]:
        """Ages in a frame, in field periods, of the fields that `after_gap` names."""
        return () if self.after_gap is None else {"older": (1,), "both": (0, 1)}[self.after_gap]

    @field_validator("field_orders", mode="before")
    @classmethod
    def _named(cls, names: Any) -> Any:
        """Arrangements by name; never ANY, with which several drivers deliver one field at half height."""
        known = {a.name.lower(): a for a in Arrangement if a is not Arrangement.ANY}
        if not isinstance(names, list | tuple):
            raise ValueError("a list of field orders is expected")
        strange = [str(name) for name in names if str(name) not in known]
        if strange:
            raise ValueError(f"{', '.join(strange)}: none of {', '.join(known)}")
        return tuple(known[str(name)] for name in names)


class Profiles(NamedTuple):
    """All profiles.

    Attributes:
        by_driver: Profiles by each name of a driver.
        remarks: Problems with files of the installer, which are not used.
    """

    by_driver: Mapping[str, Profile]
    remarks: tuple[str, ...]

    @classmethod
    def load(cls, directory: Path = DIRECTORY) -> "Profiles":
        """Loads the built-in profiles, with keys overridden by the installer's file for the same driver.

        An invalid file is skipped and reported in `remarks`.
        """
        # Documents are merged, not profiles, so that a file can override single keys.
        documents = dict(_built_in())
        remarks = []
        for file in _yaml_files(directory):
            try:
                merged = _merged(documents, _read(file))
                Profile(**merged)
            except (OSError, ValueError) as error:
                remarks.append(f"profile {file} is not used: {_in_words(error)}")
            else:
                documents[merged["driver"]] = merged
        profiles = [Profile(**document) for document in documents.values()]
        return cls({name: p for p in profiles for name in (p.driver, *p.also)}, tuple(remarks))

    def of(self, kernel_driver: str, usb_id: str = "") -> Profile:
        """The profile of a device, or of its driver, or the default profile under the driver's name.

        Args:
            kernel_driver: Name of the driver.
            usb_id: "VID:PID" of the device; "" if it is not on USB.
        """
        known = self.by_driver.get(f"{kernel_driver} {usb_id}") or self.by_driver.get(kernel_driver)
        return known or self.by_driver[DEFAULT].model_copy(update={"driver": kernel_driver})


def _merged(documents: Mapping[str, dict[str, Any]], own: dict[str, Any]) -> dict[str, Any]:
    """The built-in document of the driver, under any of its names, overridden by the installer's values."""
    named = {name: d["driver"] for d in documents.values() for name in d.get("also", ())}
    driver = named.get(own["driver"], own["driver"])
    family = driver.partition(" ")[0]  # a device's profile inherits from its driver's
    base = documents.get(driver) or documents.get(family) or documents[DEFAULT]
    return {**base, **own, "driver": driver}


def _yaml_files(directory: Traversable) -> Iterable[Traversable]:
    if not directory.is_dir():
        return ()
    return sorted((file for file in directory.iterdir() if file.name.endswith(".yaml")), key=str)


@cache
def _built_in() -> Mapping[str, dict[str, Any]]:
    """Documents of the package by driver, read once: a device is opened again and again."""
    return {document["driver"]: document for document in map(_read, _yaml_files(files(__package__)))}


def _read(file: Traversable) -> dict[str, Any]:
    document = parse_yaml(read_text(file))
    if not isinstance(document, dict) or not isinstance(document.get("driver"), str):
        raise ValueError("it has no key 'driver' with the name of a kernel driver")
    return document


def _in_words(error: Exception) -> str:
    """All problems on one line."""
    if isinstance(error, ValidationError):
        return "; ".join(f"{'.'.join(map(str, e['loc']))}: {said(e['msg'])}" for e in error.errors())
    return " ".join(str(error).split())
