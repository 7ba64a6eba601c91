"""How the program opens, holds, checks and writes any file: one place for locks, descriptors and full disks."""
