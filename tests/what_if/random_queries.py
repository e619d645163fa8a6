"""Random queries, good and bad, by seed; a bad one is known to be so by how it was made."""

from __future__ import annotations

import copy
import json
import math
import random

import yaml

DAMPER = {"linear_damping": (0.0, 20.0), "quadratic_damping": (2.0, 60.0),
          "coulomb_torque": (0.0, 30.0)}
GEAR = {"strut_inertia": 60.0, "wheel_mass": 25.0, "trunnion_to_axle": 1.1, "trail": 0.08,
        "swivel_inertia": 1.0, "wheel_polar_inertia": 0.6, "wheel_radius": 0.3,
        "damper_inertia": 0.005, "strut_tilt_stiffness": 5e5, "damper_linkage_stiffness": 6e4,
        "strut_rake": 0.1, "tyre_lateral_stiffness": 2.5e5, "tyre_torsional_stiffness": 3e3,
        "rolling_alpha": 28.0, "rolling_beta": 10.0, "rolling_gamma": 1.0}
SPREAD = 0.1


def good(seed):
    """A valid query about limit cycles, as a mapping with an id."""
    rng = random.Random(seed)
    query = {"id": f"good-{seed}"}
    if rng.random() < 0.9:
        query["taxi_velocity"] = _value(rng, 0.5 if rng.random() < 0.1 else 10.0, 100.0)
    for name in rng.sample(sorted(DAMPER), rng.choice((0, 1, 1, 2))):
        query[name] = _value(rng, *DAMPER[name])
    for name in rng.sample(sorted(GEAR), rng.choice((0, 0, 1, 2))):
        query[name] = _value(rng, (1.0 - SPREAD) * GEAR[name], (1.0 + SPREAD) * GEAR[name])
    if rng.random() < 0.3:
        query["harmonics"] = rng.randint(1, 9)
    if rng.random() < 0.2:
        query["limits"] = {rng.choice(("swivel", "strut_tilt", "tyre_deflection")):
                           rng.uniform(0.01, 1.0)}
    if rng.random() < 0.3:
        query["return"] = rng.choice(("limit_cycle", ["limit_cycle"]))
    items = list(query.items())
    rng.shuffle(items)
    return dict(items)


def text(query, seed):
    """The query as JSON, as YAML in a block, or as YAML on one line."""
    kind = seed % 3
    if kind == 0:
        return json.dumps(query)
    return yaml.safe_dump(query, default_flow_style=kind == 2, sort_keys=False,
                          width=10**6)


def values(entry):
    """The numbers that an entry of a query stands for."""
    if isinstance(entry, list):
        return entry
    if isinstance(entry, dict):
        count = entry["points"]
        step = (entry["to"] - entry["from"]) / (count - 1)
        return [entry["from"] + index * step for index in range(count)]
    return [entry]


def bad(seed):
    """A query that must be refused, as a mapping, and the place that has to be named."""
    rng = random.Random(seed)
    query = good(seed)
    query["id"] = f"bad-{seed}"
    numbers = [name for name in query if name in DAMPER or name in GEAR or name == "taxi_velocity"]
    name = rng.choice(numbers) if numbers else "taxi_velocity"
    query.setdefault(name, 40.0)
    wrong = rng.choice(_WRONG)
    return wrong(rng, copy.deepcopy(query), name)


def garbled(seed):
    """The text of a good query with some characters changed, which may leave it good."""
    rng = random.Random(seed)
    letters = list(text(good(seed) | {"id": f"garbled-{seed}"}, seed))
    for _ in range(rng.randint(1, 3)):
        place = rng.randrange(len(letters))
        what = rng.choice(("drop", "add", "change", "cut"))
        letter = rng.choice('{}[]:,"\'0159.-+eE \n\t\\&*!|>%@#xnulltrue\u00e9\u2603\x00')
        if what == "drop":
            del letters[place]
        elif what == "add":
            letters.insert(place, letter)
        elif what == "change":
            letters[place] = letter
        else:
            del letters[place:place + rng.randint(1, 12)]
        if not letters:
            letters = ["x"]
    return "".join(letters)


def _value(rng, low, high):
    kind = rng.random()
    if kind < 0.6:
        return rng.uniform(low, high)
    if kind < 0.8:
        return [rng.uniform(low, high) for _ in range(rng.randint(1, 3))]
    start, end = rng.uniform(low, high), rng.uniform(low, high)
    return {"from": start, "to": end, "points": rng.randint(2, 4)}


def _with(query, name, value, where):
    return {**query, name: value}, where


def _unknown(rng, query, name):
    stranger = rng.choice(
        ("velocity", "qudratic_damping", "damper.trail", "Find", "", "ID", "x" * 99))
    return _with(query, stranger, 1.0, stranger)


def _wrong_type(rng, query, name):
    return _with(query, name, rng.choice(
        ("fast", "40", None, True, {}, {"from": 1.0}, "1e3 m/s")), name)


def _out_of_range(rng, query, name):
    return _with(query, name, rng.choice(
        (-1e9, 1e15, math.inf, math.nan, -math.inf, 10**400)), name)


def _wrong_in_list(rng, query, name):
    item = rng.choice(("fast", None, [], -1e9, True))
    return _with(query, name, [item], f"{name}[0]")


def _empty_list(rng, query, name):
    return _with(query, name, [], name)


def _wrong_grid(rng, query, name):
    start, end = (1.0, 2.0) if name == "taxi_velocity" else (0.09, 0.1)
    grid = {"from": start, "to": end, "points": 3}
    kind = rng.choice(("points", "from", "lacks", "more"))
    if kind == "points":
        grid["points"] = rng.choice((1, 0, -3, 2.5, "3", None, 10**9, math.nan))
        return _with(query, name, grid, f"{name}.points")
    if kind == "from":
        grid["from"] = rng.choice((-1e9, "a", None, math.nan, True))
        return _with(query, name, grid, f"{name}.from")
    if kind == "more":
        return _with(query, name, {**grid, "step": 1.0}, f"{name}.step")
    del grid[rng.choice(("from", "to", "points"))]
    return _with(query, name, grid, name)


def _harmonics(rng, query, name):
    return _with(query, "harmonics", rng.choice((0, 65, 2.5, "4", None, -1, True, 1e30)),
                 "harmonics")


def _accuracy(rng, query, name):
    query.pop("harmonics", None)
    return _with(query, "accuracy", rng.choice((0.0, 1.0, -0.1, "high", None)), "accuracy")


def _limits(rng, query, name):
    value, where = rng.choice((
        (0.5, "limits"), (None, "limits"), ([0.5], "limits"),
        ({"wheel": 0.5}, "limits.wheel"), ({"swivel": 0.0}, "limits.swivel"),
        ({"swivel": "wide"}, "limits.swivel"), ({"strut_tilt": -0.1}, "limits.strut_tilt"),
        ({"tyre_deflection": "2 deg"}, "limits.tyre_deflection")))
    return _with(query, "limits", value, where)


def _returns(rng, query, name):
    value, where = rng.choice((
        ("all", "return"), ([], "return"), (["margin", "all"], "return[1]"), (3, "return"),
        (["limit_cycle", "limit_cycle"], "return"), (None, "return"), ({}, "return")))
    return _with(query, "return", value, where)


def _find(rng, query, name):
    for entry in ("return", "coulomb_torque", "linear_damping"):
        query.pop(entry, None)
    sense, wanted = rng.choice(("smallest", "largest")), "coulomb_torque"
    value, where = rng.choice((
        (None, "find"), ({}, "find"), ({sense: wanted}, "find"), ({"below": 0.1}, "find"),
        ({sense: "torque", "below": 0.1}, f"find.{sense}"),
        ({sense: wanted, "below": -0.1}, "find.below"),
        ({sense: wanted, "below": "2 degrees"}, "find.below"),
        ({sense: wanted, "below": 0.1, "amplitude": "wing"}, "find.amplitude"),
        ({sense: wanted, "below": 0.1, "between": [2.0, 1.0]}, "find.between"),
        ({sense: wanted, "below": 0.1, "between": [-1.0, 1.0]}, "find.between[0]"),
        ({sense: wanted, "below": 0.1, "beyond": 1.0}, "find.beyond"),
        ({"smallest": wanted, "largest": wanted, "below": 0.1}, "find"),
        ({"largest_loss": wanted, "below": 0.1, "between": [0.0, 1.0]}, "find.between")))
    return _with(query, "find", value, where)


def _id(rng, query, name):
    return _with(query, "id", rng.choice((5, "", None, [], "x" * 101, True)), "id")


def _cancel(rng, query, name):
    return _with(query, "cancel", "good-1", None)


def _heavy(rng, query, name):
    return _with(query, "wheel_mass", 5000.0, "")


_WRONG = (_unknown, _wrong_type, _out_of_range, _wrong_in_list, _empty_list, _wrong_grid,
          _harmonics, _accuracy, _limits, _returns, _find, _id, _cancel, _heavy)
