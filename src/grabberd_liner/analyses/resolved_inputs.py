"""Inputs of a capture's analysis: what is given, completed by profiles and by what was recorded."""

from typing import TYPE_CHECKING

from grabberd.documents.named_types import JsonObject
from grabberd_liner.profiles.documents import ProfileUse
from grabberd_liner.profiles.profile_text import plain_name
from grabberd_liner.profiles.profiles import FoundProfiles

if TYPE_CHECKING:
    from grabberd_liner.chain.analysis.profile import Profile
    from grabberd_liner.chain.analysis.profile_inputs import ResolvedInputs, Subject


def resolved_inputs(given: JsonObject, found: FoundProfiles | None, subject: "Subject") -> "ResolvedInputs":
    """The inputs, and where those come from that were not given.

    Args:
        given: Inputs that are given; they win.
        found: Profiles that complete them; None: they are left as they are.
        subject: The capture.

    Raises:
        InputError: Profiles contradict the capture.
    """
    from grabberd_liner.chain.analysis.profile import Profile  # noqa: PLC0415
    from grabberd_liner.chain.analysis.profile_inputs import ResolvedInputs, resolve  # noqa: PLC0415

    if found is None:
        return ResolvedInputs(dict(given))
    labels = {key: plain_name(value) for key, value in found.labels.items()}
    known = [Profile(one.kind, one.name, one.version, one.sha256, one.profile) for one in found.profiles]
    return resolve(labels, known, given, subject)


def use_of(profile: "Profile") -> ProfileUse:
    """A profile as a record names it."""
    return ProfileUse(kind=profile.kind, name=profile.name, version=profile.version, sha256=profile.sha256)
