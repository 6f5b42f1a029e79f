"""Processing of many recordings, in processes of this machine or on a Dask cluster."""

from tablemap.runs.jobs import Job, done_already, expand
from tablemap.runs.processes import process_many

__all__ = ["Job", "done_already", "expand", "process_many"]
