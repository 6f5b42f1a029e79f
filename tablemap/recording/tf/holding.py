"""Corrections of the odometry that come rarely, late, or end early.

A localisation sends ``map -> odom``, and the wheels ``odom -> base``. The correction says how far
the wheels have drifted, which changes by millimetres a second: it stays valid until the next one.
Some localisations send it on a change alone, and some start after the recording.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.recording.tf.frame_roles import FrameNames, pose_stamps
from tablemap.recording.tf.frames import TransformTree

_NAMED_S = 1.0
"""A shorter lack is usual: the wheels send faster than the localisation."""


def held_corrections(
    tree: TransformTree, names: FrameNames
) -> tuple[TransformTree, list[ProcessWarning]]:
    """Return the tree whose corrections are held where the wheels go on, and a warning.

    Nothing is held if all poses of the wheels have a correction, or no wheels were recorded.
    """
    if names.odom is None or names.odom == names.fixed:
        return tree, []
    motion = {id(edge) for way in tree.path(names.odom, names.carrier) for edge in way}
    whole = [edge for way in tree.path(names.fixed, names.carrier) for edge in way]
    if not motion <= {id(edge) for edge in whole}:
        return tree, []
    corrections = [edge for edge in whole if id(edge) not in motion]
    stamps = pose_stamps(tree, names.odom, names.carrier)
    lacking = np.zeros(len(stamps), dtype=bool)
    for edge in corrections:
        lacking |= ~edge.at(stamps)[1]
    if not lacking.any() or len(stamps) < 2:
        return tree, []
    held = {id(edge) for edge in corrections}
    edges = [replace(edge, is_held=True) if id(edge) in held else edge for edge in tree.all_edges]
    first = int(stamps[np.argmax(lacking)])
    missing = float(np.diff(stamps)[lacking[:-1] | lacking[1:]].sum()) / 1e9
    if missing < _NAMED_S:
        return tree.with_edges(edges), []
    message = (
        f"Nothing was localised ({names.fixed} to {names.odom}) for {missing:.1f} of the "
        f"{(int(stamps[-1]) - int(stamps[0])) / 1e9:.1f} s of odometry, first "
        f"{(first - int(stamps[0])) / 1e9:.1f} s after its begin; the correction before was taken "
        "(at the begin the first one), and the wheels carried it on."
    )
    warning = ProcessWarning("recording.localisation_gap", "recording", message, first)
    return tree.with_edges(edges), [warning]
