"""What a grabber, a disk, a clock or a client can do wrong, done to the whole daemon."""
