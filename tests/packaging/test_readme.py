"""The README says what the package does: its table, its commands, its files."""

import re
from pathlib import Path

import pytest

from shimmy_ros.cli.main import main
from shimmy_ros.contract.spec import topics_table

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_table_of_topics_is_the_contract():
    assert README.split("<!-- topics -->\n")[1].split("<!-- /topics -->")[0] == topics_table()


@pytest.mark.parametrize("command", sorted(set(re.findall(r"^    shimmy (\w+)", README, re.M))))
def test_every_command_exists(command, capsys):
    with pytest.raises(SystemExit) as ended:
        main([command, "--help"])
    assert ended.value.code == 0
    assert command in capsys.readouterr().out


def test_every_linked_file_exists():
    targets = [target for target in re.findall(r"\]\(([^)]+)\)", README) if "://" not in target]
    assert targets
    assert all((ROOT / target).exists() for target in targets), targets


def test_the_two_commands_come_first():
    assert README.index("make demo") < README.index("make test") < README.index("\n## ")


def test_every_package_is_in_the_map():
    listed = re.findall(r"^    ([\w/]+)/ +\S", README.split("## What is where")[1], re.M)
    found = (*ROOT.glob("shimmy_ros/*/__init__.py"), ROOT / "benchmarks" / "__init__.py")
    assert sorted(listed) == sorted(path.parent.relative_to(ROOT).as_posix() for path in found)
