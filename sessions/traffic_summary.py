"""What the summary of a traffic file tells without its messages being read."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from mcap.exceptions import McapError
from mcap.reader import make_reader

from sessions.traffic_reader import segment_paths


def may_hold(path: Path, topics: Collection[str]) -> bool:
    """Whether a recording may hold a message of one of these topics.

    Args:
        path: of its first file.
        topics: to look for.

    Returns:
        False only when every file of it has a summary, and none names one of the topics.
    """
    return any(_names_one(segment, topics) for segment in segment_paths(path))


def _names_one(path: Path, topics: Collection[str]) -> bool:
    try:
        with path.open("rb") as file:
            summary = make_reader(file).get_summary()
    except (OSError, McapError, ValueError):
        return True  # whoever reads it will find out
    return summary is None or any(channel.topic in topics for channel in summary.channels.values())
