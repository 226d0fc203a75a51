"""Bags of ROS 1 and ROS 2 (SQLite and MCAP): the ``sensor_msgs/JointState`` messages in them, by topic and joint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from casysid.errors import MissingExtraError, RecordingError
from casysid.readers.batches import Batch, from_row
from casysid.readers.candidates import Labels
from casysid.readers.messages import listing, refuse_too_many

MESSAGE = "sensor_msgs/msg/JointState"
STAMP = "header.stamp"
LISTS = ("position", "velocity", "effort")
ROWS = 1 << 13
"""Messages that are kept in memory; as lists of Python they take ten times the room of an array."""
LOOKED_AT = 100
"""Messages of each topic that tell its joints: several publishers may share one."""


@dataclass(frozen=True)
class BagTable:
    """Joint states of a bag, a column for each topic, joint and quantity.

    Attributes:
        path: The bag.
        columns: Topic, joint and quantity by name; a topic alone for its stamps.
    """

    path: Path
    columns: dict[str, tuple[str, str, str]]

    @property
    def names(self) -> tuple[str, ...]:
        """Such as ``/joint_states/elbow/position``."""
        return tuple(self.columns)

    @property
    def labels(self) -> Labels:
        """See :class:`~casysid.readers.table.Table`."""
        return Labels()

    @property
    def nameless(self) -> str:
        """See :class:`~casysid.readers.table.Table`."""
        return ""

    @property
    def seekable(self) -> bool:
        """See :class:`~casysid.readers.table.Table`."""
        return False

    def batches(self, names: Sequence[str], first: int = 0) -> Iterator[Batch]:
        """The named columns batch by batch; see :class:`~casysid.readers.table.Table`."""
        yield from from_row(self._batches(names), first)

    def place(self, row: int) -> str:
        """Message, counted from 1."""
        return f"message {row + 1} of its topic"

    def _batches(self, names: Sequence[str]) -> Iterator[Batch]:
        topics = {self.columns[name][0] for name in names}
        stamps: list[int] = []
        rows: list[list[float]] = []
        wanted = [(k, *self.columns[name]) for k, name in enumerate(names)]
        with _messages(self.path, topics) as messages:
            for topic, received, message in messages:
                stamp = _nanoseconds(message.header.stamp)
                stamps.append(stamp or received)
                rows.append(_row(topic, message, wanted))
                if len(rows) == ROWS:
                    yield self._together(names, stamps, rows)
                    stamps, rows = [], []
        if rows:
            yield self._together(names, stamps, rows)

    def _together(self, names: Sequence[str], stamps: list[int], rows: list[list[float]]) -> Batch:
        values = np.array(rows, dtype=np.float64)
        moments = np.array(stamps, dtype=np.int64)
        return {name: moments if self.columns[name][2] == STAMP else values[:, k] for k, name in enumerate(names)}


def _row(topic: str, message: Any, wanted: Sequence[tuple[int, str, str, str]]) -> list[float]:
    places = {joint: k for k, joint in enumerate(message.name)}
    lists = {word: getattr(message, word) for word in LISTS}
    row = [np.nan] * len(wanted)
    for k, own, joint, word in wanted:
        place = places.get(joint, -1) if own == topic and word != STAMP else -1
        if 0 <= place < len(lists.get(word, ())):
            row[k] = float(lists[word][place])
    return row


def _nanoseconds(stamp: Any) -> int:
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def open_bag(path: Path) -> BagTable:
    """The joint states of a bag: a file of ROS 1, an MCAP or SQLite file of ROS 2, or the folder of one.

    Raises:
        MissingExtraError: The package rosbags is not installed.
        RecordingError: It is no bag, is damaged, or holds no joint states.
    """
    joints: dict[str, dict[str, set[str]]] = {}
    seen: dict[str, int] = {}
    with _messages(path, None) as messages:
        for topic, _, message in messages:
            seen[topic] = seen.get(topic, 0) + 1
            if seen[topic] <= LOOKED_AT:
                for k, joint in enumerate(message.name):
                    known = joints.setdefault(topic, {}).setdefault(str(joint), set())
                    known |= {word for word in LISTS if k < len(getattr(message, word))}
            elif min(seen.values()) >= LOOKED_AT:
                break
    columns: dict[str, tuple[str, str, str]] = {}
    for topic, found in joints.items():
        columns[f"{topic}/{STAMP}"] = (topic, "", STAMP)
        for word in LISTS:
            columns |= {f"{topic}/{joint}/{word}": (topic, joint, word) for joint in found if word in found[joint]}
        refuse_too_many(len(columns), str(path))
    return BagTable(path, columns)


@contextmanager
def _messages(path: Path, topics: set[str] | None) -> Iterator[Iterator[tuple[str, int, Any]]]:
    """Topic, time of receipt [ns] and message of all joint states, or of some topics.

    Raises:
        MissingExtraError: The package rosbags is not installed.
        RecordingError: The bag is damaged, or holds none.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise MissingExtraError(
            f"{path}: bags of ROS are read by the package rosbags, which is not installed; pip install 'casysid[ros]'"
        ) from error
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            chosen = [one for one in reader.connections if one.msgtype == MESSAGE]
            if not chosen:
                kinds = sorted({f"{one.topic} ({one.msgtype})" for one in reader.connections})
                raise RecordingError(f"{path}: holds no {MESSAGE}, which are read; found {listing(kinds, 8)}")
            chosen = [one for one in chosen if topics is None or one.topic in topics]
            read = reader.messages(connections=chosen)
            yield ((one.topic, int(received), reader.deserialize(raw, one.msgtype)) for one, received, raw in read)
    except (RecordingError, MissingExtraError, GeneratorExit):
        raise
    except Exception as error:  # whatever the bytes of a stranger make a decoder raise means damage
        raise RecordingError(
            f"{path}: no bag of ROS, or damaged ({type(error).__name__}: {str(error)[:200]}); copy or record it again"
        ) from error
