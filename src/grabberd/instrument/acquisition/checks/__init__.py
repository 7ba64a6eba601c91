"""Checks of a live field's content, because grabbers deliver most damage without any error flag.

`no_picture` recognises what a chip draws when no camera is connected, `stale_rows` rows left over from an
earlier field, `shifted_rows` the sideways shift after a lost USB packet; `content_check` runs all three on
every field, in the same pass over its rows that packs it. Recordings are not checked: their fields may
legitimately repeat.
"""
