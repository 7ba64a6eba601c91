"""A light in the picture that this computer switches, read like a logger of what it does.

`switched_light` is the driver: a thread of its own switches and says when. A line of a serial port
(`serial_line`) or of a GPIO chip (`gpio_line`) is what it switches.
"""
