"""Makes a long bag, as of a rig: velocity at 50 Hz, gear response at 500 Hz.

    python tests/replay/long_bag.py SECONDS OUT

The velocity wanders between 15 and 85 m/s like that of landings and take-offs in a row, and the
response is a sine whose amplitude follows it: enough for measuring how long a replay takes.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

from shimmy_ros.bag.writer import BagWriter
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.records import GearResponse, TaxiVelocity
from shimmy_ros.contract.spec import load_contract

VELOCITY_HZ, RESPONSE_HZ = 50, 500
START_NS = 1_700_000_000_000_000_000
SHIMMY_HZ = 18.0


def taxi_velocity(time_s):
    """The velocity [m/s] at a time [s]; three periods, so that no stretch repeats."""
    return 50.0 + 25.0 * math.sin(time_s / 21.0) + 9.0 * math.sin(time_s / 5.3) + math.sin(time_s)


def response(time_s):
    """Position and rate of the swivel [rad, rad/s]."""
    amplitude = 0.002 * taxi_velocity(time_s)
    angle = 2.0 * math.pi * SHIMMY_HZ * time_s
    return amplitude * math.sin(angle), amplitude * 2.0 * math.pi * SHIMMY_HZ * math.cos(angle)


def write_long_bag(directory, seconds):
    """Write the bag; its log times are its stamps."""
    with BagWriter(directory, chunk_seconds=None) as bag:
        names = {name: bag.add_topic(load_contract().topic(name), "/shimmy")
                 for name in ("taxi_velocity", "gear_response")}
        for index in range(int(seconds * RESPONSE_HZ)):
            time_s = index / RESPONSE_HZ
            stamp = START_NS + index * 10**9 // RESPONSE_HZ
            if index % (RESPONSE_HZ // VELOCITY_HZ) == 0:
                record = TaxiVelocity(stamp, taxi_velocity(time_s))
                bag.write(names["taxi_velocity"], CODECS["taxi_velocity"].encode(record), stamp)
            swivel, rate = response(time_s)
            record = GearResponse(stamp, (0.1 * swivel, swivel, 0.9 * swivel, 0.05 * swivel),
                                  (0.1 * rate, rate, 0.9 * rate, 0.05 * rate),
                                  (0.0, math.copysign(20.0, -rate), -2.0 * rate, 0.0))
            bag.write(names["gear_response"], CODECS["gear_response"].encode(record), stamp)


if __name__ == "__main__":
    write_long_bag(Path(sys.argv[2]), float(sys.argv[1]))
