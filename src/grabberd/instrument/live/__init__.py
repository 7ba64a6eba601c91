"""Live documents and pictures: devices, newest points, illumination, preview, and changes of the state.

All of it is made from snapshots of the device threads, without waiting for a device.
"""
