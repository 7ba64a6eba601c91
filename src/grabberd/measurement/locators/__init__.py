"""Locators: methods of computing a blob's centre, one file each.

The paper compares centroid, Vernier, Tian-Huhns, edge and correlation (3.5); `template` (a fitted disc) is
the most accurate with grey values, `weighted` nearly as accurate at half the cost, and locale decoding, the
best at 1 bit, has a folder of its own. `locator` defines their common input and output, `windows` and
`disc_image` what several of them use. Those that no default selects are imported only when asked for
(`measurement.settings`).
"""
