"""Limit cycles of x'' - mu (1 - x^2) x' + T sgn(x') + x = 0, a van der Pol oscillator that rubs."""

from shimmy_ros.ihb.accuracy import solve_to_accuracy
from shimmy_ros.ihb.elements import Coulomb, OddElement
from shimmy_ros.ihb.stability import stability
from shimmy_ros.ihb.system import System

MU = 1.0
# mu x^2 x' with its derivatives by x and by x', as arrays over coordinates and instants.
GROWING_DAMPING = OddElement(
    (0,), lambda x, v: MU * x**2 * v, lambda x, v: 2.0 * MU * (x * v)[None],
    lambda x, v: MU * (x**2)[None])
# Torque, accuracy, amplitude, frequency: without friction published, with it by integration.
KNOWN = [(0.0, 1e-8, 2.008619861, 0.942955847), (0.1, 1e-4, 1.942464020, 0.936300646)]

for torque, accuracy, amplitude, frequency in KNOWN:
    elements = (Coulomb(0, torque), GROWING_DAMPING)
    system = System(mass=[[1.0]], damping=[[-MU]], stiffness=[[1.0]], elements=elements)
    result, _ = solve_to_accuracy(system, accuracy)
    cycle = result.limit_cycle
    kind = "stable" if stability(system, cycle).stable else "unstable"
    print(f"T = {torque}: amplitude {cycle.amplitude()[0]:.9f} (known {amplitude:.9f}), "
          f"frequency {cycle.frequency:.9f} rad/s (known {frequency:.9f}), {kind}, "
          f"{cycle.harmonics} harmonics")
