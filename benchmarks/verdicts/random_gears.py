"""Random gears of three kinds, each repeatable by its kind, seed and index."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np

from shimmy_ros.gear.parameter_file import reference_parameters
from shimmy_ros.gear.parameters import Damper, Gear, ParameterError

KINDS = {
    "a": "the reference gear, every parameter times exp(-0.4 to 0.4)",
    "b": "the reference gear, every parameter times 1/3 to 3",
    "c": "as a or b, with any trail from -0.1 to 0.24 m, rake to 0.3 rad, gamma to 3 1/m",
}
_NEAR, _FAR = 0.4, np.log(3.0)


def random_gear(kind: str, seed: int, index: int) -> tuple[Gear, Damper, float]:
    """The gear of this number, its damper, and its taxi velocity [m/s].

    Friction and damping cover what makes rest, cycles and growth all frequent. Parameters that
    Gear refuses, for their mass matrix, are drawn again.
    """
    if kind not in KINDS:
        raise ValueError(f"kind is {kind!r}, but must be one of {', '.join(KINDS)}")
    rng = np.random.default_rng([ord(kind), seed, index])
    reference = asdict(reference_parameters()[0])
    while True:
        width = {"a": _NEAR, "b": _FAR}.get(kind) or rng.choice([_NEAR, _FAR])
        values = {name: value * np.exp(rng.uniform(-width, width))
                  for name, value in reference.items()}
        if kind == "c":
            values |= {"trail": rng.uniform(-0.1, 0.24), "strut_rake": rng.uniform(-0.3, 0.3),
                       "rolling_gamma": rng.uniform(-3.0, 3.0)}
        damper = Damper(10.0 ** rng.uniform(-1.0, 1.5), 10.0 ** rng.uniform(-0.5, 2.5),
                        10.0 ** rng.uniform(-1.0, 2.2))
        velocity = float(np.exp(rng.uniform(np.log(3.0), np.log(150.0))))
        try:
            return Gear(**values), damper, velocity
        except ParameterError:
            continue
