"""Frames that a sensor's messages name with another prefix than TF does.

A driver that is started without the robot's prefix stamps ``camera`` where TF has ``robot/camera``,
or the other way round.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from tablemap.errors import ProcessWarning
from tablemap.recording.tf.frames import TransformEdge, TransformTree


def with_aliases(
    tree: TransformTree, sensors: Iterable[tuple[str, str]]
) -> tuple[TransformTree, list[ProcessWarning]]:
    """Return the tree with the frames of sensors that it has by another prefix, and warnings.

    ``sensors`` are pairs of a topic and its frame, which TF lacks. A frame with several namesakes
    is that of the topic's namespace, else none.
    """
    edges: list[TransformEdge] = []
    said: list[ProcessWarning] = []
    for topic, frame in dict.fromkeys(sensors):
        same = [name for name in tree.frames if frame and _are_namesakes(name, frame)]
        if len(same) > 1:
            same = [name for name in same if topic.strip("/").startswith(_prefix(name))]
        if len(same) != 1 or any(edge.child == frame for edge in edges):
            continue
        here = np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 1.0]])
        edges.append(TransformEdge(same[0], frame, np.zeros(1, dtype=np.int64), *here))
        said.append(
            ProcessWarning(
                "recording.frame_name",
                "recording",
                f"Messages on {topic} are stamped in {frame!r}, which TF lacks; {same[0]!r} of TF "
                "was taken for it. Give the driver TF's name.",
            )
        )
    if not edges:
        return tree, []
    return tree.with_edges([*tree.all_edges, *edges]), said


def _are_namesakes(first: str, second: str) -> bool:
    """Tell whether two frames differ by a prefix alone."""
    return first != second and (first.endswith(f"/{second}") or second.endswith(f"/{first}"))


def _prefix(frame: str) -> str:
    return f"{frame.rpartition('/')[0]}/"
