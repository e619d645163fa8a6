"""Pictures of limit cycles over a parameter: stable ones solid, unstable ones dashed."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..cycles.diagram import Diagram, DiagramPoint
from ..cycles.verdict import Verdict
from ..gear.matrices import SWIVEL
from ..gear.parameters import HALF_TURN
from ..ihb.solution import Outcome

_LINES = {True: "-", False: "--", None: ":"}
_WITHIN, _BEYOND = "tab:blue", "tab:orange"
_BEYOND_LIMITS = "beyond limits"

# How outcomes without a cycle are marked, in the order of the key. Heights are parts of the axis;
# None stands for the envelope.
_MARKS: dict[Outcome, tuple[str, float | None, dict[str, Any]]] = {
    Outcome.NO_LIMIT_CYCLE: ("no limit cycle", 0.0, {"color": "0.45", "marker": "|"}),
    Outcome.UNBOUNDED: ("unbounded", 0.97, {"color": "tab:red", "marker": "^"}),
    Outcome.NOT_PERIODIC: ("not periodic: envelope", None, {"color": "tab:purple", "marker": "D"}),
    Outcome.NOT_ROLLING: ("not rolling", 0.0, {"color": "tab:brown", "marker": "s"}),
    Outcome.NOT_CONVERGED: ("did not converge", 0.03, {"color": "black", "marker": "x"}),
}


def draw_diagram(diagram: Diagram, label: str, title: str, file: Path) -> None:
    """Swivel amplitude and frequency over a parameter, and what is no cycle, as PNG.

    Raises OSError. Cycles beyond half a turn are left out, and a note says so.
    """
    shown = [point for point in diagram.points if point.orbit.swivel <= HALF_TURN]
    figure = Figure(figsize=(9.0, 8.5), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title)
    amplitude, frequency = figure.subplots(2, 1, sharex=True)
    for axis, is_frequency in ((amplitude, False), (frequency, True)):
        draw_branches(axis, shown, frequency=is_frequency, beyond={"color": _BEYOND},
                      color=_WITHIN)
        _draw_answers(axis, diagram, frequency=is_frequency)
        axis.grid(True, alpha=0.3)
    amplitude.set_ylabel("swivel amplitude [deg]")
    frequency.set_ylabel("frequency [Hz]")
    frequency.set_xlabel(label)
    frequency.set_xlim(diagram.values[0], diagram.values[-1])
    _draw_outcomes(amplitude, diagram)
    amplitude.set_ylim(bottom=0.0)
    _key(amplitude, shown)
    handles, labels = amplitude.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", ncols=4,
                      fontsize="small")
    if len(shown) < len(diagram.points) or any(_out_of_picture(verdict)
                                               for verdict in diagram.verdicts.values()):
        # Above the axes, where no curve can run into it.
        amplitude.annotate(
            f"cycles beyond {np.degrees(HALF_TURN):.0f} deg are not shown", (1.0, 1.005),
            xycoords="axes fraction", ha="right", va="bottom", fontsize="small", color="0.4")
    figure.savefig(file, dpi=110)


def draw_branches(axis: Axes, points: Sequence[DiagramPoint], *, frequency: bool,
                  beyond: dict[str, Any], **style: Any) -> None:
    """Each branch as lines: solid where stable, dashed where not, dotted where that is unknown.

    Folds are dots. ``beyond`` is what is another style beyond the model's limits.
    """
    for number in sorted({point.branch for point in points}):
        branch = sorted((point for point in points if point.branch == number),
                        key=lambda point: point.order)
        for (stable, is_beyond), piece in _pieces(branch):
            axis.plot([point.value for point in piece],
                      [_height(point, frequency) for point in piece],
                      **{**style, "linestyle": _LINES[stable], **(beyond if is_beyond else {})})
        folds = [point for point in branch if point.is_fold]
        axis.plot([point.value for point in folds],
                  [_height(point, frequency) for point in folds],
                  **{**style, "linestyle": "none", "marker": "o", "markersize": 4.0})


def _draw_answers(axis: Axes, diagram: Diagram, *, frequency: bool) -> None:
    """The cycles that a kick leads to, as dots, hollow beyond the model's limits."""
    for within, face in ((True, _WITHIN), (False, "white")):
        found = [(diagram.values[index], verdict.orbit)
                 for index, verdict in sorted(diagram.verdicts.items())
                 if verdict.orbit is not None and (not verdict.excesses) is within
                 and not _out_of_picture(verdict)]
        if found:
            heights = [orbit.frequency_hz if frequency else np.degrees(orbit.swivel)
                       for _, orbit in found]
            words = "a kick leads here" + ("" if within else f", {_BEYOND_LIMITS}")
            axis.plot([value for value, _ in found], heights, linestyle="none", marker="o",
                      markersize=5.5, markerfacecolor=face, alpha=0.6 if within else 1.0,
                      markeredgecolor=_WITHIN if within else _BEYOND, label=words)


def _draw_outcomes(axis: Axes, diagram: Diagram) -> None:
    """Marks for what is no cycle, and a band where growth has no bound."""
    at = axis.get_xaxis_transform()
    values = diagram.values
    verdicts = [diagram.verdicts.get(index) for index in range(len(values))]
    outcomes = [None if verdict is None else verdict.outcome for verdict in verdicts]
    for outcome, (words, height, style) in _MARKS.items():
        found = [index for index, here in enumerate(outcomes) if here is outcome]
        if not found:
            continue
        style = {"linestyle": "none", "clip_on": False, "label": words, **style}
        if height is None:
            envelopes = [(value, verdict.envelope) for value, verdict in zip(
                values, verdicts, strict=True) if verdict and verdict.envelope is not None]
            axis.plot([value for value, _ in envelopes],
                      [np.degrees(envelope[SWIVEL]) for _, envelope in envelopes], **style)
        else:
            axis.plot([values[index] for index in found], [height] * len(found), transform=at,
                      **style)
    for unbounded, run in groupby(range(len(values)), key=lambda index: (
            outcomes[index] is Outcome.UNBOUNDED)):
        if not unbounded:
            continue
        run_of = list(run)
        low = 0.5 * (values[max(run_of[0] - 1, 0)] + values[run_of[0]])
        high = 0.5 * (values[run_of[-1]] + values[min(run_of[-1] + 1, len(values) - 1)])
        axis.axvspan(low, high, color="tab:red", alpha=0.08, linewidth=0.0)
    beyond = [values[index] for index, verdict in enumerate(verdicts)
              if verdict is not None and _out_of_picture(verdict)]
    if beyond:
        axis.plot(beyond, [0.97] * len(beyond), transform=at, linestyle="none", marker="^",
                  markerfacecolor="white", markeredgecolor=_BEYOND, clip_on=False,
                  label=f"stable cycle beyond {np.degrees(HALF_TURN):.0f} deg")


def _out_of_picture(verdict: Verdict) -> bool:
    return verdict.orbit is not None and verdict.orbit.swivel > HALF_TURN


def _height(point: DiagramPoint, frequency: bool) -> float:
    return point.orbit.frequency_hz if frequency else float(np.degrees(point.orbit.swivel))


_Kind = tuple[bool | None, bool]


def _pieces(branch: Sequence[DiagramPoint]) -> list[tuple[_Kind, list[DiagramPoint]]]:
    """Runs of one stability within or beyond the limits, each beginning where the one before ends;
    a fold joins two."""
    pieces: list[tuple[_Kind, list[DiagramPoint]]] = []
    for before, after in pairwise(branch):
        stable = before.orbit.stable if after.is_fold else after.orbit.stable
        kind = stable, bool(after.beyond_limits)
        if not pieces or pieces[-1][0] != kind:
            pieces.append((kind, [before]))
        pieces[-1][1].append(after)
    return pieces


def _key(axis: Axes, points: Sequence[DiagramPoint]) -> None:
    for kind, style in (("stable", {"linestyle": "-"}), ("unstable", {"linestyle": "--"}),
                        ("stability unknown", {"linestyle": ":"}),
                        ("fold", {"linestyle": "none", "marker": "o", "markersize": 4.0})):
        if any(_kind(point) == kind for point in points):
            axis.plot([], [], color=_WITHIN, label=kind, **style)
    if any(point.beyond_limits for point in points):
        axis.plot([], [], color=_BEYOND, label=f"cycles {_BEYOND_LIMITS}")


def _kind(point: DiagramPoint) -> str:
    if point.is_fold:
        return "fold"
    return {True: "stable", False: "unstable", None: "stability unknown"}[point.orbit.stable]
