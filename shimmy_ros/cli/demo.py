"""``shimmy demo``: a run played to predictor and simulator over DDS; a bag and a picture of it."""

from __future__ import annotations

import argparse
import json
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from ..gear.parameter_file import REFERENCE_GEAR, load_parameters
from ..gear.parameters import ParameterError
from ..resources import resource_directory
from .options import Commands
from .progress import INTERRUPTED, Stop, signals_held, stoppable
from .runs import SYNTHETIC, Run, bundled_run, read_run, synthetic_run

if TYPE_CHECKING:
    from ..nodes.rig import Play

NAMESPACE = "/shimmy"
DEFAULT_RUN = "landing_EDW229"
# The braking phase; with start and end of everything the demo stays below a minute.
_DEFAULT_STRETCH_S = (20.0, 60.0)
_CHANGE_AT = 0.55
_CHANGED_DAMPER = {"quadratic_damping": 20.0, "coulomb_torque": 15.0}
_STOP_TIMEOUT_S = 20.0


class NodeError(RuntimeError):
    """A node ended when it should not have, or not as it should have."""


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "demo", help="play a run to the two nodes; leaves a bag and a picture",
        description="Start predictor and simulator, play a velocity history to them in real time "
        "with a change of the damper on the way, and leave an MCAP bag and a picture. Needs ROS 2.")
    parser.add_argument(
        "--run", metavar="FILE", default=DEFAULT_RUN, dest="run_name",
        help="CSV with time_s and taxi_velocity_m_per_s, the name of a run in config/runs, or "
        f"{SYNTHETIC} (default: 40 s of {DEFAULT_RUN})")
    parser.add_argument("--from", type=float, metavar="S", dest="start", help="start there, s")
    parser.add_argument("--to", type=float, metavar="S", dest="end", help="end there, s")
    parser.add_argument("--gear", metavar="FILE", type=Path, help="params file of both nodes "
                        "(default: the reference gear, which is invented)")
    parser.add_argument("--out", metavar="DIR", type=Path, default=Path("out"),
                        help="where bag and picture go (default: %(default)s)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Play, stop, draw; raises ParameterError on bad input."""
    history = _history(options)
    gear_file = options.gear or resource_directory("config") / REFERENCE_GEAR
    try:
        with signals_held():
            from ..nodes.domain import isolated_run
            from ..nodes.rig import Play
    except ImportError as error:
        raise ParameterError(
            "the demo needs ROS 2 Jazzy's rclpy, from a sourced ROS or, in the source tree, by "
            f"pip install '.[ros]' ({error})") from error
    _, damper = load_parameters(gear_file)
    # All of the damper at the start, so that the bag tells the whole story.
    play = Play(history.time, history.velocity,
                {0.0: asdict(damper), _CHANGE_AT * history.time[-1]: _CHANGED_DAMPER})
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ParameterError(f"--out is {options.out}, but must be a directory or a name for one: "
                             f"{error.strerror}") from error
    bag = options.out / history.name
    _remove_bag(bag)
    with stoppable() as stop, isolated_run() as domain:
        print(f"domain   {domain} (ROS_DOMAIN_ID), this host alone", flush=True)
        try:
            _play(play, gear_file, bag, stop)
        except (NodeError, RuntimeError) as error:
            print(f"shimmy: {error}", file=sys.stderr)
            return 1
    if stop.requested and not bag.exists():
        return INTERRUPTED
    _report(bag, options.out / f"{history.name}.png", history)
    return INTERRUPTED if stop.requested else 0


def _history(options: argparse.Namespace) -> Run:
    name = options.run_name
    if name == SYNTHETIC:
        history = synthetic_run()
    else:
        file = Path(name)
        history = read_run(file if file.suffix or file.exists() else bundled_run(name))
    start, end = options.start, options.end
    if name == DEFAULT_RUN and start is None and end is None:
        start, end = _DEFAULT_STRETCH_S
    if start is None and end is None:
        return history
    return history.between(0.0 if start is None else start,
                           history.time[-1] if end is None else end)


def _play(play: Play, gear_file: Path, bag: Path, stop: Stop) -> None:
    """Start both nodes, play until it is over or ``stop``, stop them.

    Raises NodeError and RigError.
    """
    from ..nodes.rig import Rig

    common = ["-r", f"__ns:={NAMESPACE}", "--params-file", str(gear_file)]
    # A parameter's value is YAML, and so is a string of JSON, whatever the path looks like.
    bag_directory = f"bag_directory:={json.dumps(str(bag))}"
    arguments = {"predictor": common, "simulator": [*common, "-p", bag_directory]}
    nodes: dict[str, subprocess.Popen[bytes]] = {}

    def go_on() -> bool:
        for name, process in nodes.items():
            if process.poll() is not None:
                raise NodeError(f"the {name} ended with status {process.returncode}")
        return not stop.requested

    # Whoever ends the demo ends the nodes, which would run on otherwise.
    try:
        for name in arguments:
            nodes[name] = _start(name, arguments[name])
        rig = Rig(NAMESPACE)
        try:
            rig.wait_for_nodes(go_on)
            with tqdm(total=round(play.time[-1], 1), unit="s", desc="playing",
                      disable=not sys.stderr.isatty()) as bar:
                def progress(done: float) -> None:
                    bar.update(round(done - bar.n, 3))

                rig.play(play, go_on, progress)
        finally:
            rig.close()
    finally:
        _stop(nodes)


def _start(node: str, arguments: list[str]) -> subprocess.Popen[bytes]:
    # A session of its own keeps a Ctrl-C on the terminal from reaching the nodes before the rig.
    return subprocess.Popen(
        [sys.executable, "-m", f"shimmy_ros.nodes.{node}", "--ros-args", "--log-level", "warn",
         *arguments], start_new_session=True)


def _stop(nodes: Mapping[str, subprocess.Popen[bytes]]) -> None:
    """Ask every node to stop and wait for it; NodeError where one does not end cleanly."""
    for process in nodes.values():
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    failures = []
    for name, process in nodes.items():
        try:
            status = process.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            failures.append(f"the {name} did not stop in {_STOP_TIMEOUT_S:g} s")
        else:
            # One that was still starting does not catch the signal yet.
            if status not in (0, -signal.SIGINT):
                failures.append(f"the {name} ended with status {status}")
    if failures:
        raise NodeError("; ".join(failures))


def _remove_bag(bag: Path) -> None:
    """Remove the bag of an earlier run; anything else in its place stays. Raises ParameterError."""
    if not bag.exists():
        return
    if not bag.is_dir() or any(
            item.suffix != ".mcap" and item.name != "metadata.yaml" for item in bag.iterdir()):
        raise ParameterError(f"--out is {bag.parent}, but must not hold a {bag.name} other than "
                             "the bag of an earlier demo")
    shutil.rmtree(bag)


def _report(bag: Path, picture: Path, history: Run) -> None:
    # matplotlib takes its time to import, and is not needed before.
    from ..report.comparison import compare, summary
    from ..report.picture import draw_run
    from ..report.recording import read_recording

    recording = read_recording(bag, NAMESPACE)
    comparison = compare(recording)
    draw_run(recording, comparison,
             f"{history.name}: reference gear (invented), predicted and simulated", picture)
    print(f"bag      {bag}\npicture  {picture}\nfound    {summary(comparison, recording)}")
