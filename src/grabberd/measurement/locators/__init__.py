"""The locators that the paper compares (3.5), and those that came after, one file each."""
