"""Sensors and converters of Linux' industrial I/O subsystem, by the kernel's ABI (sysfs-bus-iio).

`tree` finds devices and their channels in sysfs; `readers` reads them, polled, one file a channel, or in
scans through the character device, each with a time of the kernel's own; `logger` is the driver.
"""
