"""Format 2 of the capture file: groups of fields, compressed together, a row each.

A group holds what one commit adds, half a second at 50 Hz. `quanta` decides what is stored of a point,
`point_codec` and `picture_codec` turn arrays into columns of bytes, `group_rows` reads them as rows.
"""
