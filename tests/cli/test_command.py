"""What all subcommands share: help, a reader that has had enough, and what is imported."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from shimmy_ros.cli.main import COMMANDS, main


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help_of_its_own(name, capsys):
    with pytest.raises(SystemExit) as end:
        main([name, "--help"])
    assert end.value.code == 0
    assert f"usage: shimmy {name}" in capsys.readouterr().out


def test_the_help_names_every_command(capsys):
    with pytest.raises(SystemExit) as end:
        main(["--help"])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert all(f"    {name}" in out for name in COMMANDS)


@pytest.mark.parametrize("arguments", [[], ["none"], ["predict", "--no-such"]])
def test_what_is_no_command_ends_with_two(arguments, capsys):
    with pytest.raises(SystemExit) as end:
        main(arguments)
    assert end.value.code == 2
    assert "shimmy" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["predict", "--velocity=40"],
                                       ["sweep", "--from=40", "--to=60"]])
def test_a_reader_that_has_had_enough_ends_it_quietly(arguments):
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run([sys.executable, "-m", "shimmy_ros.cli.main", *arguments], stdout=writer,
                          stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, "")


def test_a_replay_does_without_what_only_others_need():
    program = ("import sys; import shimmy_ros.cli.replay; "
               "print([name for name in ('scipy.optimize', 'matplotlib') if name in sys.modules])")
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True,
                          check=True)
    assert done.stdout.strip() == "[]"
