"""How far harmonic balance is from the numerical reference and what each costs, as a table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..cycles.method_comparison import MethodRun
from ..gear.parameters import Damper
from .branch_table import Row


def method_name(run: MethodRun) -> str:
    """The method in words."""
    if run.harmonics is None:
        return "numerical reference (shooting)"
    plural = "" if run.harmonics == 1 else "s"
    return f"harmonic balance, {run.harmonics} harmonic{plural}"


def difference_row(damper: Damper, run: MethodRun, reference: MethodRun) -> Row:
    """The table's line for one method and case; what is not there is None."""
    difference = None if run is reference else run.compared_with(reference)
    row: Row = {
        "quadratic_damping": damper.quadratic_damping, "coulomb_torque": damper.coulomb_torque,
        "method": method_name(run), "velocities": None, "median_amplitude_percent": None,
        "worst_amplitude_percent": None, "worst_at_m_per_s": None,
        "median_frequency_percent": None, "worst_frequency_percent": None,
        "ms_per_velocity": 1e3 * run.seconds_per_cycle,
        "times_faster": reference.seconds_per_cycle / run.seconds_per_cycle,
    }
    if difference is not None:
        row |= {
            "velocities": len(difference.velocities),
            "median_amplitude_percent": 100.0 * float(np.median(difference.amplitude)),
            "worst_amplitude_percent": 100.0 * float(difference.amplitude.max()),
            "worst_at_m_per_s": difference.worst_at,
            "median_frequency_percent": 100.0 * float(np.median(difference.frequency)),
            "worst_frequency_percent": 100.0 * float(difference.frequency.max()),
        }
    return row


def table_text(rows: Sequence[Row]) -> str:
    """The table for a terminal."""
    lines = [f"{'C_d':>5} {'T_CF':>5}  {'method':<31} {'swivel amplitude, %':>27}  "
             f"{'frequency, %':>16}  {'cost per velocity':>20}",
             f"{'':>5} {'':>5}  {'':<31} {'median':>8} {'worst':>8} {'at m/s':>9}  "
             f"{'median':>8} {'worst':>7}  {'ms':>10} {'faster':>9}"]
    for row in rows:
        values = [row["median_amplitude_percent"], row["worst_amplitude_percent"]]
        parts = [f"{row['quadratic_damping']:5g} {row['coulomb_torque']:5g}  {row['method']:<31}"]
        if row["velocities"] is None:
            parts.append(f"{'':>27}  {'':>16}")
        else:
            parts.append(f"{values[0]:8.3f} {values[1]:8.3f} {row['worst_at_m_per_s']:9g}  "
                         f"{row['median_frequency_percent']:8.4f} "
                         f"{row['worst_frequency_percent']:7.4f}")
        parts.append(f"{row['ms_per_velocity']:11.2f} {row['times_faster']:8.1f}x")
        lines.append(" ".join(parts))
    return "\n".join(lines)


def summary_text(cases: Sequence[tuple[Damper, Sequence[MethodRun]]]) -> str:
    """For each method its difference from the reference, the last run, over all cases together."""
    lines = []
    for methods in zip(*(runs[:-1] for _, runs in cases), strict=True):
        found = [(difference, damper) for run, (damper, runs) in zip(methods, cases, strict=True)
                 if (difference := run.compared_with(runs[-1])) is not None]
        if not found:
            continue
        amplitude = np.concatenate([difference.amplitude for difference, _ in found])
        worst, damper = max(found, key=lambda item: float(item[0].amplitude.max()))
        lines.append(
            f"{method_name(methods[0])}, swivel amplitude at {len(amplitude)} points: median "
            f"{100.0 * np.median(amplitude):.3f} %, worst {100.0 * worst.amplitude.max():.3f} % "
            f"(C_d {damper.quadratic_damping:g}, T_CF {damper.coulomb_torque:g}, "
            f"{worst.worst_at:g} m/s)")
    return "\n".join(lines)
