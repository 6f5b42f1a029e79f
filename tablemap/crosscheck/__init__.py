"""Camera against laser, by what both see of the table."""

from tablemap.crosscheck.check import cross_check
from tablemap.crosscheck.effect import admitted_legs, corrected
from tablemap.crosscheck.result import CrossCheck, Estimate

__all__ = ["CrossCheck", "Estimate", "admitted_legs", "corrected", "cross_check"]
