"""``shimmy replay``: a bag through the predictor, and its answers as a bag."""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path

from ..bag.errors import BagError
from ..bag.output import check_new, new_bag, new_place
from ..bag.reader import Bag
from ..contract.session import REFERENCE_HARDWARE, UNSTAMPED, Session
from ..contract.spec import load_contract
from ..cycles.prediction import Predictor
from ..replay.replay import DEFAULT_NAMESPACE, Inputs, Replay, find_inputs
from ..replay.writing import AnswerWriter
from .options import Commands, add_gear_options, add_settings_options, gear_and_damper, settings_of
from .progress import INTERRUPTED, STOPPED, stoppable, until_stopped

NO_ANSWER = 1
_RESPONSE = "gear_response"


def add_command(commands: Commands) -> None:
    """Declare the subcommand."""
    parser: argparse.ArgumentParser = commands.add_parser(
        "replay", help="what the predictor answers to a recorded bag",
        description="Feed a bag's taxi velocities and damper changes to the predictor and write a "
        "bag with its answers, the same that a live node gives. Reads rosbag2 bags (MCAP, SQLite, "
        "compressed or not, split or cut) and ROS 1 bags. Exit status 0 with answers, 1 without "
        "one, 2 on bad input, 130 when interrupted, with what was finished in the bag.")
    parser.add_argument("bag", metavar="BAG", type=Path, help="directory or file")
    parser.add_argument("-o", "--output", metavar="OUT", type=Path,
                        help="directory of the new bag (default: the bag's name with _replay)")
    parser.add_argument(
        "--velocity-topic", metavar="T[:FIELD]",
        help="topic of the taxi velocity: TwistStamped, Twist, Odometry, Float64, or any type with "
        "the path of a number in it, as in /gps:speed.x (default: the one named taxi_velocity)")
    parser.add_argument(
        "--namespace", metavar="N",
        help="where the damper's topics are and the answers go (default: that of the topic "
        f"taxi_velocity, or else {DEFAULT_NAMESPACE})")
    parser.add_argument("--with-input", action="store_true",
                        help="copy the bag's own messages, but for older answers, into the new bag")
    parser.add_argument("--compare", action="store_true",
                        help="also write OUT.csv and OUT.png: measured cycles and predictions")
    parser.add_argument("--response-topic", metavar="T[:JOINT]",
                        help="JointState to compare with (default: gear_response, joint swivel)")
    add_gear_options(parser)
    add_settings_options(parser)
    parser.add_argument("--hardware-id", metavar="ID", default=REFERENCE_HARDWARE,
                        help="of the status messages, as the node's parameter "
                        "(default: %(default)s)")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Replay and report; raises ParameterError and BagError on bad input, and OSError."""
    gear, damper = gear_and_damper(options)
    session = Session(gear, damper, Predictor(settings_of(options)))
    bag = Bag(options.bag)
    channels = bag.channels()
    inputs = find_inputs(channels, options.velocity_topic, options.namespace)
    out = options.output or default_output(options.bag, "replay")
    check_new(out)
    also: set[str] = set()
    if options.compare:
        # Importing it takes its time, and it is not needed otherwise.
        from ..replay.measured import SWIVEL, MotionComparison, motion_reader

        topic, _, joint = (options.response_topic or load_contract().topic(_RESPONSE).resolved(
            inputs.namespace)).partition(":")
        read_motion = motion_reader(bag, channels, topic, joint or SWIVEL)
        also.add(topic)
    replay = Replay(bag, channels, inputs, session, None if options.with_input else also)
    with ExitStack() as stack:
        stop = stack.enter_context(stoppable())
        writer = AnswerWriter(
            stack.enter_context(new_bag(out, _settings(session, inputs))),
            inputs, session, options.hardware_id, options.with_input)
        comparison = None
        if options.compare:
            table = stack.enter_context(new_place(out.with_name(f"{out.name}.csv")))
            picture = stack.enter_context(new_place(out.with_name(f"{out.name}.png")))
            comparison = MotionComparison(
                stack.enter_context(table.open("w", encoding="utf-8")), inputs, topic, read_motion)
        for step in until_stopped(replay, stop, "replaying", lambda: replay.messages.fraction):
            writer.write(step)
            if comparison is not None:
                comparison.take(step.message, session, writer.records(step))
        if not replay.samples and not stop.requested:
            raise BagError(f"the bag has no message on topic {inputs.velocity}")
        found = "" if comparison is None else comparison.finish(
            dict(writer.outcomes), f"{options.bag.name}: predicted and measured", picture)
    _report(replay, writer, out, found)
    if stop.requested:
        print(STOPPED, file=sys.stderr)
        return INTERRUPTED
    return 0 if writer.outcomes else NO_ANSWER


def default_output(bag: Path, suffix: str) -> Path:
    """A name in the working directory, made from that of the bag."""
    name = bag.resolve().name
    if not bag.is_dir():
        for known in (".zstd", ".mcap", ".db3", ".bag", ".active"):
            name = name.removesuffix(known)
    return Path(f"{name}_{suffix}")


def _settings(session: Session, inputs: Inputs) -> dict[str, str]:
    """What the answers depend on besides the bag, for the new one."""
    used = session.predictor.settings
    settings = {
        **{f"gear.{name}": value for name, value in asdict(session.gear).items()},
        **{f"damper.{name}": value for name, value in asdict(session.damper).items()},
        **{f"limits.{name}": value for name, value in asdict(used.limits).items()},
        "harmonics": used.harmonics, "accuracy": used.accuracy, "budget": used.budget,
        "minimum_velocity": used.minimum_velocity,
        "velocity_topic": inputs.velocity, "velocity_field": inputs.field,
        "namespace": inputs.namespace,
    }
    return {name: repr(value) for name, value in settings.items()}


def _report(replay: Replay, writer: AnswerWriter, out: Path, found: str) -> None:
    """What was written to stdout, what is remarkable about the input to stderr."""
    kinds = ", ".join(f"{outcome} {count}" for outcome, count in writer.outcomes.items())
    print(f"bag      {out}\nanswers  {writer.outcomes.total()}{f' ({kinds})' * bool(kinds)}")
    if found:
        print(f"table    {out}.csv\npicture  {out}.png\nfound    {found}")
    session = replay.session
    notes = list(replay.messages.damage)
    notes += [f"refused {count} messages on {topic}, the first because {replay.complaints[topic]}"
              for topic, count in replay.refused.items()]
    if replay.jump:
        others = f" (the first of {session.jumps} such jumps)" if session.jumps > 1 else ""
        notes.append(replay.jump + others)
    if session.unstamped:
        notes.append(f"{UNSTAMPED} ({session.unstamped} of them)")
    for note in notes:
        print(f"shimmy: {note}", file=sys.stderr)
