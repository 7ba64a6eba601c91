"""The archive: captures on disk, their documents, lists and annotations, and how long they are kept."""
