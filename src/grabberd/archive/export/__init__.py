"""Points, pictures, analyses and data sets in the formats of other programs.

Tables consist of `grabberd.core.chain.columns.Column`: points and data sets of those in `points_columns`,
an extension has its own. Each format has one writer, `FORMAT_file`, which
takes any such table; a new column therefore is one line in a specification.
"""
