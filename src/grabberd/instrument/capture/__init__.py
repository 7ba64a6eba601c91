"""Captures from request to sealed file.

`CaptureControl` is what the API calls. A start passes through three files: `capture_start` takes the steps,
for one device or several at once, `recorder` takes the fields from the ring into a backlog, and `recording`
takes them from there into the file. `device_captures` keeps which capture a device has.
"""
