"""``make bench``: every figure of docs/performance.md, in one run, into out/bench.json."""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

for _variable in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_variable] = "1"

from .measuring import Spread  # noqa: E402


def main() -> int:
    """Measure, print as it goes, write what is finished even when interrupted."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks")
    parser.add_argument("--out", type=Path, default=Path("out/bench.json"))
    parser.add_argument("--memory-seconds", type=float, default=60.0,
                        help="length of the memory run at 1 kHz (default: %(default)s)")
    options = parser.parse_args()
    results: dict[str, dict[str, float]] = {}
    status = 0
    try:
        for key, found, note in _figures(options.memory_seconds):
            results[key] = found._asdict()
            print(f"{key:34} {found.median:10.3g}  ({found.min:.3g} to {found.max:.3g})  {note}",
                  flush=True)
    except KeyboardInterrupt:
        status = 130
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")
    print(f"written to {options.out}")
    return status


def _figures(memory_seconds: float) -> Iterator[tuple[str, Spread, str]]:
    from . import solver

    yield from solver.warm_figures()
    yield from solver.branch_figures()
    yield from solver.scaling_figures()
    yield from solver.grid_figures(os.cpu_count() or 1)
    yield from solver.simulator_figures()
    try:
        from . import node
    except ImportError as error:
        print(f"the node is not measured: {error}", file=sys.stderr)
        return
    yield from node.node_figures(memory_seconds)


if __name__ == "__main__":
    sys.exit(main())
