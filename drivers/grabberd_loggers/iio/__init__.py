"""Sensors and converters of Linux' industrial I/O subsystem, by the kernel's ABI (sysfs-bus-iio).

`tree` finds devices and their channels in sysfs. A device is either polled, one file a channel (`polled`), or
streams scans through its character device, each with a time of the kernel's own (`buffered`, whose bytes
`scan` decodes). `logger` is the driver.
"""
