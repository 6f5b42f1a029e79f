"""Scans that several stages ask for are read once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tablemap.recording import LaserScan, Recording, open_recording, recent


def asked(recording: Recording, stamps_ns: list[int]) -> list[LaserScan]:
    """Ask for the scans at some stamps."""
    return list(recording.scans(stamps_ns=stamps_ns))


def test_scans_come_again_in_their_order(plain_recording: Path) -> None:
    """Those that are held, and those between that are not, are the same as all read at once."""
    with open_recording(plain_recording) as fresh, open_recording(plain_recording) as recording:
        stamps = recording.scan_stamps().tolist()
        first = asked(recording, stamps[1::3])
        again = asked(recording, stamps)
        assert [scan.stamp_ns for scan in again] == stamps
        assert all(one is other for one, other in zip(first, again[1::3], strict=True))
        for one, other in zip(again, fresh.scans(), strict=True):
            assert np.array_equal(one.ranges, other.ranges, equal_nan=True)


def test_few_are_held(plain_recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond the bound, those that nobody asked for lately are read anew."""
    with open_recording(plain_recording) as recording:
        stamps = recording.scan_stamps().tolist()[:4]
        size = next(recording.scans()).ranges.nbytes
        monkeypatch.setattr(recent, "MOST_BYTES", 2 * size)
        one, two, three = asked(recording, stamps[:3])
        assert asked(recording, stamps[1:2])[0] is two
        asked(recording, stamps[3:4])
        held = asked(recording, stamps[1:2])
        assert held[0] is two
        assert asked(recording, stamps[2:3])[0] is not three
        assert asked(recording, stamps[:1])[0] is not one
