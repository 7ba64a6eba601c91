"""Location by the compiled kernel: what it is given, and what comes back.

`binary_location` and `grey_location` say which settings the kernel covers, mirror the structures of its
headers, and call it. The numpy twins, which the kernel must equal, are in the neighbouring folders.
"""
