"""The review: results written to an .rrd, its blueprint, and the viewer."""

from tablemap.review.reviewer import Reviewer
from tablemap.review.viewer.viewer import open_viewer

__all__ = ["Reviewer", "open_viewer"]
