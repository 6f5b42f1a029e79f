"""Camera against laser, by what both see of the table."""

from tablemap.stages.crosscheck.effect import admitted_legs, corrected
from tablemap.stages.crosscheck.result import CrossCheck, Estimate
from tablemap.stages.crosscheck.stage import cross_check

__all__ = ["CrossCheck", "Estimate", "admitted_legs", "corrected", "cross_check"]
