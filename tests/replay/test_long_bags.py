"""Memory does not grow with the bag."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

RUN = r"""
import re, sys
from pathlib import Path
from shimmy_ros.cli.main import main
status = main(["replay", *sys.argv[1:]])
# Not getrusage(), whose largest size includes that of the process that started this one.
print(status, re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())[1])
"""


@pytest.fixture(scope="module")
def directory(tmp_path_factory):
    """Holds a bag of ten seconds and one of eighty."""
    directory = tmp_path_factory.mktemp("long")
    for seconds in (10, 80):
        subprocess.run([sys.executable, Path(__file__).parent / "long_bag.py", f"{seconds}",
                        f"{seconds}"], check=True, cwd=directory, env=environment())
    return directory


def environment():
    return os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])}


def memory_mb(directory, *arguments):
    printed = subprocess.run([sys.executable, "-c", RUN, *arguments], check=True, cwd=directory,
                             env=environment(), stdout=subprocess.PIPE, text=True).stdout
    status, kilobytes = printed.splitlines()[-1].split()
    assert status == "0"
    return int(kilobytes) / 1024


def test_memory_is_the_same_for_eight_times_the_length(directory):
    # The first run after a change of the solver compiles it, which takes memory of its own.
    memory_mb(directory, "10", "-o", "first")
    short = memory_mb(directory, "10", "-o", "short", "--with-input")
    long = memory_mb(directory, "80", "-o", "long", "--with-input")
    assert long < 300
    # A chunk that is being read and one that is being written, but nothing for each message,
    # of which there are 38,500 more.
    assert long - short < 12
