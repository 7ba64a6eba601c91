"""Memory that runs out, as the libraries that read captures tell it."""


def is_for_want_of_memory(error: Exception) -> bool:
    """True if memory was lacking; OpenCV and SQLite have errors of their own for it."""
    return isinstance(error, MemoryError) or "insufficient memory" in str(error).lower()
