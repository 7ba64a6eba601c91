"""The paper's processes: the pure rooms strung together over iterables of fields; no files, no threads, no clocks."""
