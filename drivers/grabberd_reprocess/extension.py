"""Re-measuring whole archives as an extension: the command, for this computer or a Dask cluster."""

from grabberd.extension import Extension, Place

EXTENSION = Extension(
    name="reprocess", commands=(Place("reprocess", "grabberd_reprocess.command", after="export"),)
)
