"""Live documents and pictures: devices, newest points, illumination, preview, and changes of the state.

Everything here is read from snapshots that the device threads leave behind; nobody waits for a device.
"""
