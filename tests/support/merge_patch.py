"""Changes of the state, applied as a client does."""

from grabberd.documents.document import JsonObject


def merged(document: JsonObject, change: JsonObject) -> JsonObject:
    """Applies a change to a document; null values stay, to distinguish them from keys that never existed."""
    result = dict(document)
    for key, value in change.items():
        known = result.get(key)
        inner = known if isinstance(known, dict) else {}
        result[key] = merged(inner, value) if isinstance(value, dict) else value
    return result
