"""Captures from request to sealed file.

`CaptureControl` is what the API calls. A start passes through three files: `group_start` takes the steps for
all devices together, `capture_start` does them for one device, and `recording` is the capture that then runs,
with its recorder, backlog and writer. `device_captures` keeps which capture a device has.
"""
