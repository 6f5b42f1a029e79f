"""The laser scans that were read last: most stages ask for the same ones."""

from __future__ import annotations

from tablemap.config.limits import MIB
from tablemap.recording.messages import LaserScan
from tablemap.recording.tf.frames import Stamps

MOST_BYTES = 16 * MIB
"""Of ranges: five thousand scans of 720 beams, those of forty stops and of the drives between."""


class RecentScans:
    """Holds the scans that were read last, as many as have room in `MOST_BYTES`."""

    def __init__(self) -> None:
        self._held: dict[int, LaserScan] = {}  # the first one was not asked for longest
        self._bytes = 0

    def at(self, stamps_ns: Stamps) -> dict[int, LaserScan]:
        """Return by stamp, in the order of (n,) stamps, those scans that are held."""
        found = {}
        for stamp in stamps_ns.tolist():
            scan = self._held.pop(stamp, None)
            if scan is not None:
                found[stamp] = self._held[stamp] = scan
        return found

    def keep(self, scan: LaserScan) -> None:
        """Hold a scan that was read, and give up others if need be."""
        self._held[scan.stamp_ns] = scan
        self._bytes += scan.ranges.nbytes
        while self._bytes > MOST_BYTES:
            oldest = next(iter(self._held))
            self._bytes -= self._held.pop(oldest).ranges.nbytes
