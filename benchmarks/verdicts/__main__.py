"""``python -m benchmarks.verdicts``: random gears, what is true of them, what the package says."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

from .campaign import ask, report, truths_table, with_progress  # noqa: E402
from .grading import Graded  # noqa: E402
from .random_gears import KINDS  # noqa: E402
from .truths import COARSE, FINE, Truth, found_truths, read_truths  # noqa: E402

_INTERRUPTED = 130


def main() -> int:
    """Exit status 0 if nothing is wrong, 1 if something is, 130 if interrupted."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.verdicts", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="\n".join(f"kind {kind}: {meaning}" for kind, meaning in KINDS.items()))
    parser.add_argument("--kind", choices=sorted(KINDS), default="a")
    parser.add_argument("--gears", type=int, metavar="N", default=100,
                        help="how many, from index 0 (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, nargs="+", metavar="INDEX",
                        help="ask the package about these alone")
    parser.add_argument("--truths", type=Path, metavar="FILE",
                        help="JSON lines: truths that are there are read, others are added")
    parser.add_argument("--fine", action="store_true",
                        help=f"{len(FINE)} kicks from {FINE[0]:g} to {FINE[-1]:g} rad/s instead of "
                        + ", ".join(f"{kick:g}" for kick in COARSE))
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--compare-only", action="store_true",
                      help="all gears of the file, as they are in it; nothing is integrated")
    what.add_argument("--truths-only", action="store_true", help="do not ask the package")
    options = parser.parse_args()
    if options.compare_only and options.truths is None:
        parser.error("--compare-only needs --truths FILE")
    truths: list[Truth] = []
    results: list[Graded] = []
    status = 0
    try:
        if options.compare_only:
            source = iter(read_truths(options.truths))
            total = len(read_truths(options.truths))
        else:
            ladder = FINE if options.fine else COARSE
            source = found_truths(options.kind, options.seed, options.gears, ladder,
                                  options.truths)
            total = options.gears
        for truth in with_progress(source, total):
            if options.only and truth.index not in options.only:
                continue
            truths.append(truth)
            if not options.truths_only:
                results.append(ask(truth))
    except KeyboardInterrupt:
        print("stopped; what was finished until then is there", file=sys.stderr)
        status = _INTERRUPTED
    print("\n".join(truths_table(truths)))
    if results:
        print("\n".join(report(results)))
    return status or int(any(result.bad for result in results))


if __name__ == "__main__":
    sys.exit(main())
