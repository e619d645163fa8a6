"""Reads one SQLite file of rosbag2 (.db3)."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing

from .errors import BagError
from .file import BagFile
from .message import BagMessage, Channel

MAGIC = b"SQLite format 3\0"

_MESSAGES = ("SELECT topic_id, id, timestamp, data FROM messages WHERE topic_id IN ({}) "
             "ORDER BY {}")


class SqliteFile(BagFile):
    """One SQLite file; ``metadata`` is empty."""

    def channels(self) -> list[Channel]:
        """The channels. Raises BagError where it holds no bag."""
        with closing(self._open()) as database:
            return list(self._channels(database).values())

    def messages(self, topics: Collection[str] | None) -> Iterator[BagMessage]:
        """The messages on ``topics`` or, with None, all of them, in the order of log time.

        Raises BagError where it holds no bag.
        """
        with closing(self._open()) as database:
            wanted = {number: channel for number, channel in self._channels(database).items()
                      if topics is None or channel.topic in topics}
            placeholders = ",".join("?" * len(wanted))
            total = _largest_number(database)
            count = 0
            damage: sqlite3.DatabaseError | None = None
            # Where the index is damaged, the messages come as they were written.
            for order in ("timestamp, id", "id"):
                try:
                    for number, id_, log_time, data in database.execute(
                            _MESSAGES.format(placeholders, order), list(wanted)):
                        count += 1
                        self.fraction = min(1.0, id_ / max(1, total))
                        yield BagMessage(wanted[number], log_time, log_time, data)
                except sqlite3.DatabaseError as error:
                    damage = error
                if count:
                    break
            if damage is not None:
                self.damage.append(f"{self.path} is damaged after {count} messages: {damage}")

    def _open(self) -> sqlite3.Connection:
        # A read-only folder would keep SQLite from reading a file with a write-ahead log, were it
        # not told that nobody else writes.
        log = self.path.with_name(self.path.name + "-wal")
        mode = "mode=ro" if log.is_file() else "immutable=1"
        try:
            database = sqlite3.connect(f"{self.path.resolve().as_uri()}?{mode}", uri=True)
            # Lets SQLite read a file that is shorter than it should be.
            database.execute("PRAGMA writable_schema=ON")
        except sqlite3.Error as error:
            raise BagError(f"{self.path} cannot be opened: {error}") from error
        return database

    def _channels(self, database: sqlite3.Connection) -> dict[int, Channel]:
        """The channels by their number in the file."""
        try:
            columns = [row[1] for row in database.execute("PRAGMA table_info(topics)")]
            definitions = {
                type_: (encoding, text.encode()) for type_, encoding, text in
                database.execute("SELECT topic_type, encoding, encoded_message_definition "
                                 "FROM message_definitions")
            } if database.execute("PRAGMA table_info(message_definitions)").fetchall() else {}
            optional = ", ".join(name if name in columns else "''"
                                 for name in ("offered_qos_profiles", "type_description_hash"))
            return {
                number: Channel(topic, type_, format_, *definitions.get(type_, ("", b""))[::-1],
                                qos, type_hash)
                for number, topic, type_, format_, qos, type_hash in database.execute(
                    f"SELECT id, name, type, serialization_format, {optional} FROM topics "
                    "ORDER BY id")
            }
        except sqlite3.DatabaseError as error:
            raise BagError(f"{self.path} cannot be read as a bag: {error}") from error


def _largest_number(database: sqlite3.Connection) -> int:
    """The number of the last message; 0 where there is none or it cannot be read."""
    try:
        return int(database.execute("SELECT max(id) FROM messages").fetchone()[0] or 0)
    except sqlite3.DatabaseError:
        return 0
