"""Records to and from the CDR bytes of their stock messages, by topic.

The bytes are little-endian CDR with its 4-byte encapsulation header: what rclpy's
``publish(bytes)`` sends, what a subscription with ``raw=True`` receives and what a bag holds.
Encoding is a function of the record alone, so that a live node and a replay give the same bytes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from .decoding import (
    decode_amplitude,
    decode_gear_response,
    decode_number,
    decode_orbit,
    decode_statuses,
    decode_taxi_velocity,
    decode_text,
)
from .encoding import (
    encode_amplitude,
    encode_gear_response,
    encode_number,
    encode_orbit,
    encode_statuses,
    encode_taxi_velocity,
    encode_text,
)
from .typestore import (
    DIAGNOSTIC_ARRAY,
    FLOAT64,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    STRING,
    TWIST_STAMPED,
)


@dataclass(frozen=True)
class Codec:
    """How the record of a topic becomes a message of ``type``, and back; both raise MessageError.

    A topic's record is a float for Float64, a str for String, a sequence of Status for
    DiagnosticArray, and for the others the record of its name.
    """

    type: str
    encode: Callable[[Any], bytes]
    decode: Callable[[bytes], Any]


_NUMBER = Codec(FLOAT64, encode_number, decode_number)
_TEXT = Codec(STRING, encode_text, decode_text)
_STATUSES = Codec(DIAGNOSTIC_ARRAY, encode_statuses, decode_statuses)

CODECS: Mapping[str, Codec] = {
    "taxi_velocity": Codec(TWIST_STAMPED, encode_taxi_velocity, decode_taxi_velocity),
    "damper/linear_damping": _NUMBER,
    "damper/quadratic_damping": _NUMBER,
    "damper/coulomb_torque": _NUMBER,
    "gear_response": Codec(JOINT_STATE, encode_gear_response, decode_gear_response),
    "limit_cycle/amplitude": Codec(JOINT_STATE, encode_amplitude, decode_amplitude),
    "limit_cycle/frequency": _NUMBER,
    "limit_cycle/orbit": Codec(JOINT_TRAJECTORY, encode_orbit, decode_orbit),
    "limit_cycle/status": _STATUSES,
    "what_if/query": _TEXT,
    "what_if/answer": _TEXT,
    "/diagnostics": _STATUSES,
}
"""The codec of every topic of the contract, by its name there."""

__all__ = [
    "CODECS", "Codec",
    "decode_amplitude", "decode_gear_response", "decode_number", "decode_orbit", "decode_statuses",
    "decode_taxi_velocity", "decode_text",
    "encode_amplitude", "encode_gear_response", "encode_number", "encode_orbit", "encode_statuses",
    "encode_taxi_velocity", "encode_text",
]
