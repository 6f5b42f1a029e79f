"""The review: results written to an .rrd, its blueprint, and the viewer."""

import os

# Rerun's own log goes to stderr, which is ours; it looks at this once, when it is imported.
_level = os.environ.get("RUST_LOG")
os.environ.setdefault("RUST_LOG", "off")
import rerun as _rerun  # noqa: E402, F401

if _level is None:
    del os.environ["RUST_LOG"]

from tablemap.review.reviewer import Reviewer  # noqa: E402
from tablemap.review.viewer.viewer import open_viewer  # noqa: E402

__all__ = ["Reviewer", "open_viewer"]
