"""Findings and misses in English sentences, from their codes and numbers."""

from collections.abc import Mapping

Values = Mapping[str, float | None]

_OF_A_FIELD = {
    "no_blob_left": "the left view shows no blob where it is predicted",
    "no_blob_right": "the right view shows no blob where it is predicted",
    "no_blob": "neither view shows a blob where it is predicted",
    "rays_apart": "the rays of its blobs do not meet",
    "off_place": "it is not where its neighbours put it",
    "unconfirmed": "it was seen only once after a long time",
    "not_identified": "no target of the object could be identified in the field",
    "cut_off": "the edge of the picture cuts it off",
    "unpredicted": "its neighbours were not seen, so that its place is unknown",
}
_OF_A_RUN = {
    "no_blob_left": "the left view shows too few blobs; look at its light, mirror and threshold",
    "no_blob_right": "the right view shows too few blobs; look at its light, mirror and threshold",
    "no_blob": "the views show too few blobs; look at light, lens and threshold",
    "rays_apart": "the rays of both views do not meet: the calibration does not fit; check it",
    "off_place": "they are not where their neighbours put them: the object file does not fit the object",
    "unconfirmed": "they were seen too seldom",
    "not_identified": "the blobs do not agree with the object file; is it that of this object?",
    "cut_off": "the edge of the picture cuts them off",
    "unpredicted": "too few of their neighbours were seen",
}


def miss_in_words(miss: str, displaced_mm: float | None = None) -> str:
    """Reason why a target was not found.

    Args:
        miss: Key of the reason.
        displaced_mm: Distance from its place, if it certainly stands off it.
    """
    if miss == "off_place" and displaced_mm is not None:
        return f"it is {displaced_mm:.1f} mm from its place in the object file"
    return _OF_A_FIELD.get(miss, miss)


def finding_in_words(code: str, values: Values, miss: str | None) -> str:
    """One finding as a sentence without a full stop."""
    known = {name: 0.0 if value is None else value for name, value in values.items()}
    if code == "few_found":
        return f"{_percent(known['share'])} of what both views should see was found: {_OF_A_RUN[miss or '']}"
    if code == "targets_missed":
        reason = miss_in_words(miss or "", values.get("displaced_mm"))
        return (
            f"{known['poor']:.0f} of {known['targets']:.0f} targets were often missed; target "
            f"{known['target']:.0f} was found in {_percent(known['share'])} of its fields: {reason}"
        )
    shares = {name: _percent(known.get(name, 0.0)) for name in ("share", "apart")}
    return _SENTENCES[code].format_map({**known, **shares})


_SENTENCES = {
    "all_found": "{share} of what both views should see was found",
    "no_fields": "no field could be measured",
    "nothing_expected": "by calibration and object file no target lies in both views; do they belong "
    "together?",
    "fields_missing": "{missing:.0f} of {fields:.0f} fields could not be measured: lost, damaged or without "
    "a picture",
    "rays_do_not_meet": "the rays of both views meet badly ({residual_sigma:.1f} σ, {apart} not at all): "
    "the calibration does not fit; check it",
}


def _percent(share: float) -> str:
    """Rounded down: 99.9 % is not all."""
    return f"{int(100 * share)} %"
