"""The topics of poses of a recording -> tracks, read only where TF lacks a pose."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from tablemap.config import LimitsConfig
from tablemap.recording.messages import DecodingError, Pose
from tablemap.recording.raw import RawMessage, Source
from tablemap.recording.tf.collector import FARTHEST
from tablemap.recording.tf.poses import PoseTrack
from tablemap.recording.topics import Topic, decoders_of

Read = Callable[[set[int]], Iterator[RawMessage]]


def read_poses(
    source: Source, topics: Sequence[Topic], limits: LimitsConfig, *, read: Read | None = None
) -> list[PoseTrack]:
    """Return the track of each topic; messages that are no valid pose are left out.

    ``read`` yields the messages of channels, by default all of them.
    """
    return [track for topic in topics if (track := _track(source, topic, limits, read)) is not None]


def _track(
    source: Source, topic: Topic, limits: LimitsConfig, read: Read | None
) -> PoseTrack | None:
    decoders, _ = decoders_of(topic.channels, limits)
    first = topic.first
    if not isinstance(first, Pose):
        return None
    stamps, values = array("q"), array("d")
    for raw in (read or source.messages)(set(decoders)):
        try:
            pose = decoders[raw.channel_id].decode(raw)
        except DecodingError:
            continue  # one missing pose between others does not matter
        assert isinstance(pose, Pose)
        if (pose.frame_id, pose.child_frame) == (first.frame_id, first.child_frame):
            stamps.append(pose.stamp_ns)
            values.extend((*pose.translation, *pose.rotation, *pose.sigma))
    table = np.array(values).reshape(-1, 10)
    norms = np.linalg.norm(table[:, 3:7], axis=1)
    sound = np.all(np.abs(table[:, :7]) < FARTHEST, axis=1) & (np.abs(norms - 1) < 0.1)
    # Of several poses with one stamp the first counts, as in tf2.
    times, order = np.unique(np.array(stamps, dtype=np.int64)[sound], return_index=True)
    table, norms = table[sound][order], norms[sound][order]
    return PoseTrack(
        topic.name,
        first.frame_id,
        first.child_frame,
        times,
        table[:, :3],
        table[:, 3:7] / norms[:, None],
        table[:, 7:],
    )
