"""Files of any kind, opened, held, checked and written: one place for locks, descriptors and full disks."""
