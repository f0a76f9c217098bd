"""Counts and records of a virtual node."""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field


@dataclass(slots=True)
class NodeStatistics:
    """Counts since the node was made; a reset of the node keeps them.

    Attributes:
        requests: requests for this node, including unsupported ones.
        unsupported: requests of a disabled command.
        motions: motions taken (section 7.10).
        words: path words queued by them.
        duplicates: motions with the counter of the last one taken, answered but not taken again.
        jumps: motions taken whose counter was not one more than the last.
        overruns: motions with more words than fitted, not taken and not answered.
        syncs: sync packets received (section 7.5).
        missed_syncs: sync packets missing in the sequence of counters.
        repeated_syncs: sync packets with the counter of the previous one.
        refused_presets: presets while the motor ran, not taken and not answered (section 7.13).
        motor_requests: motor requests taken (section 7.9).
        replaced_motor_requests: motor requests replaced by a newer one before completion.
        program_loads: openings of a program load (section 7.6).
        program_pieces: pieces of a program stored.
        repeated_pieces: pieces acknowledged but not stored twice.
        refused_pieces: pieces not acknowledged: before an opening, wrong counter, or a broken program.
        resets: resets by command (section 7.7).
    """

    requests: int = 0
    unsupported: int = 0
    motions: int = 0
    words: int = 0
    duplicates: int = 0
    jumps: int = 0
    overruns: int = 0
    syncs: int = 0
    missed_syncs: int = 0
    repeated_syncs: int = 0
    refused_presets: int = 0
    motor_requests: int = 0
    replaced_motor_requests: int = 0
    program_loads: int = 0
    program_pieces: int = 0
    repeated_pieces: int = 0
    refused_pieces: int = 0
    resets: int = 0


@dataclass(slots=True)
class PathRecord:
    """Every path word that a node has queued, in order; ten bytes of memory per word.

    Attributes:
        words: the words as on the wire, 0..65535.
        times: time of the motion of each, in seconds of the node's clock.
    """

    words: array[int] = field(default_factory=lambda: array("H"))
    times: array[float] = field(default_factory=lambda: array("d"))

    def add(self, words: list[int], now: float) -> None:
        """Append the words of one motion."""
        self.words.extend(words)
        self.times.extend([now] * len(words))
