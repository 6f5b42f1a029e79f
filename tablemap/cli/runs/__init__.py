"""``tablemap runs``: the archive of run folders."""

from tablemap.cli.runs import listing, looking, changing, moving  # isort: skip - the help's order
from tablemap.cli.runs.app import runs_app

__all__ = ["changing", "listing", "looking", "moving", "runs_app"]
