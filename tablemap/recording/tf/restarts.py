"""Odometry that starts again under way, joined so that the restart is no motion.

A node that is started anew sends ``odom -> base`` from the origin again. A localisation makes up
for it by a jump of ``map -> odom``, at once or after a while; until then the composed pose is
wrong. Both jumps are taken back: the odometry continues from where it was, and so does the
localisation's correction.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from tablemap.errors import ProcessWarning
from tablemap.geometry import Floats, invert
from tablemap.recording.tf.frame_roles import FrameNames
from tablemap.recording.tf.frames import TransformEdge, TransformTree

_FASTEST, _FASTEST_TURN = 3.0, 6.0  # metres and radians a second: no indoor robot is faster
_LEAST_JUMP, _LEAST_TURN = 0.05, 0.1  # metres, radians
_AT_ORIGIN, _EXACTLY = 0.05, 0.001  # metres and radians: a restarted node begins there
_ARM = 0.5  # metres for a radian
_SHORT_S = 0.5  # over a shorter gap the speed before and after tells the motion
_ANSWER_S = 10.0  # a localisation makes up for a restart within this time
_MOST = 20  # an odometry that jumps more often than this does not restart: it is unsteady


def joined_restarts(
    tree: TransformTree, names: FrameNames
) -> tuple[TransformTree, list[ProcessWarning]]:
    """Return the tree with the wheel odometry joined where it starts again, and a warning.

    A step is a restart if no robot can make it, or it leads exactly to the origin, and either the
    odometry is then near its origin or the localisation makes up for the jump.
    """
    edge = None if names.odom is None else _below(tree, names.odom, names.carrier)
    if edge is None:
        return tree, []
    correction = _into(tree, names)
    places = _jumps(edge)
    if not 0 < len(places) <= _MOST:
        return tree, []
    sent = edge.at(edge.stamps_ns)[0]
    motion = sent.copy()
    above = None if correction is None else correction.at(correction.stamps_ns)[0].copy()
    found: list[int] = []
    unknown_s = 0.0
    for i in places:
        gap_s = (edge.stamps_ns[i] - edge.stamps_ns[i - 1]) / 1e9
        back = _continued(edge, motion, i)
        answer = None
        if correction is not None and above is not None:
            last_ns, is_short = int(edge.stamps_ns[i - 1]), gap_s < _SHORT_S
            answer = _answer(correction, above, last_ns, back, motion[i], is_short=is_short)
        at_origin = _size(sent[i]) < (_AT_ORIGIN if gap_s < _SHORT_S else _EXACTLY)
        if answer is None and not at_origin:
            continue
        if gap_s >= _SHORT_S:
            if above is not None and answer is not None:
                back = invert(above[answer - 1]) @ above[answer]
            else:
                unknown_s = max(unknown_s, gap_s)
        motion[i:] = back @ motion[i:]
        if above is not None and answer is not None:
            above[answer:] = above[answer:] @ invert(back)
        found.append(i)
    if not found:
        return tree, []
    changed = {id(edge): _with_poses(edge, motion)}
    if correction is not None and above is not None:
        changed[id(correction)] = _with_poses(correction, above)
    mended = [changed.get(id(each), each) for each in tree.all_edges]
    return tree.with_edges(mended), [_warning(edge, found, unknown_s)]


def _below(tree: TransformTree, odom: str, carrier: str) -> TransformEdge | None:
    """Return the moving edge that leads down from the odometry's frame, None without one."""
    up_odom, up_carrier = tree.path(odom, carrier)
    if up_odom or not up_carrier:
        return None
    edge = up_carrier[-1]
    return edge if len(edge.stamps_ns) > 3 else None


def _into(tree: TransformTree, names: FrameNames) -> TransformEdge | None:
    """Return the moving edge that ends at the odometry's frame, None without one."""
    assert names.odom is not None
    if names.odom == names.fixed:
        return None
    edges = tree.edges.get(names.odom, [])
    return edges[0] if len(edges) == 1 and len(edges[0].stamps_ns) > 1 else None


def _jumps(edge: TransformEdge) -> list[int]:
    """Return the samples at which the odometry may have started again."""
    seconds = np.diff(edge.stamps_ns) / 1e9
    steps = np.linalg.norm(np.diff(edge.translations, axis=0), axis=1)
    cosine = np.abs(np.sum(edge.quaternions[1:] * edge.quaternions[:-1], axis=1))
    turns = 2 * np.arccos(np.clip(cosine, 0, 1))
    far = steps > _LEAST_JUMP + _FASTEST * seconds
    far |= turns > _LEAST_TURN + _FASTEST_TURN * seconds
    angle = 2 * np.arccos(np.clip(np.abs(edge.quaternions[1:, 3]), 0, 1))
    exact = np.linalg.norm(edge.translations[1:], axis=1) + _ARM * angle < _EXACTLY
    exact &= steps + _ARM * turns > _LEAST_JUMP
    return [int(i) + 1 for i in np.flatnonzero(far | exact)]


def _continued(edge: TransformEdge, motion: Floats, i: int) -> Floats:
    """Return what, from the left, moves sample ``i`` to where the base was by its speed."""
    seconds = np.diff(edge.stamps_ns) / 1e9
    moves = []
    for first in (i - 2, i):
        if 0 <= first < len(motion) - 1 and seconds[first] < _SHORT_S:
            step = invert(motion[first]) @ motion[first + 1]
            share = seconds[i - 1] / seconds[first]
            turn = Rotation.from_matrix(step[:3, :3]).as_rotvec()
            moves.append(np.concatenate([step[:3, 3], turn]) * share)
    move = np.mean(moves, axis=0) if moves and seconds[i - 1] < _SHORT_S else np.zeros(6)
    gone = np.eye(4)
    gone[:3, :3], gone[:3, 3] = Rotation.from_rotvec(move[3:]).as_matrix(), move[:3]
    return np.asarray(motion[i - 1] @ gone @ invert(motion[i]))


def _answer(
    correction: TransformEdge,
    above: Floats,
    last_ns: int,
    back: Floats,
    first: Floats,
    *,
    is_short: bool,
) -> int | None:
    """Return the first sample of ``map -> odom`` that makes up for a restart, None without one.

    ``back`` takes the restart back, whose gap ``is_short`` or not; ``first`` is the base's first
    pose after it.
    """
    begin = max(int(np.searchsorted(correction.stamps_ns, last_ns, side="right")), 1)
    until = np.searchsorted(correction.stamps_ns, last_ns + round(_ANSWER_S * 1e9), side="right")
    for k in range(begin, int(until)):
        before = above[k - 1] @ back @ first
        as_sent = _size(invert(before) @ (above[k] @ back @ first))
        made_up = _size(invert(before) @ (above[k] @ first))
        # Over a long gap the base's own motion is part of what is left.
        if made_up < (0.5 if is_short else 1.0) * as_sent:
            return k
    return None


def _size(pose: Floats) -> float:
    """Return the length of a (4, 4) motion in metres; a radian counts as half a metre."""
    angle = np.arccos(np.clip((np.trace(pose[:3, :3]) - 1) / 2, -1, 1))
    return float(np.linalg.norm(pose[:3, 3]) + _ARM * angle)


def _with_poses(edge: TransformEdge, poses: Floats) -> TransformEdge:
    turns = Rotation.from_matrix(poses[:, :3, :3]).as_quat()
    return replace(edge, translations=poses[:, :3, 3].copy(), quaternions=turns)


def _warning(edge: TransformEdge, found: list[int], unknown_s: float) -> ProcessWarning:
    times = "once" if len(found) == 1 else f"{len(found)} times"
    said = f"The odometry from {edge.parent} to {edge.child} starts again {times} under way"
    stamp_ns = int(edge.stamps_ns[found[0]])
    if unknown_s:
        return ProcessWarning(
            "accuracy.odometry_restart",
            "recording",
            f"{said}, and for {unknown_s:.1f} s nothing tells how the base moved; it was taken as "
            "standing. Record the localisation too, or process the parts before and after alone "
            "(--start, --end).",
            stamp_ns,
        )
    return ProcessWarning(
        "recording.odometry_restart",
        "recording",
        f"{said}; it was joined there, so that the restart is no motion.",
        stamp_ns,
    )
