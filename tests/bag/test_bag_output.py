"""Outputs that are complete or not there."""

from __future__ import annotations

import os

import pytest

from shimmy_ros.bag.errors import BagError
from shimmy_ros.bag.output import check_new, new_bag, new_place
from shimmy_ros.bag.reader import read_messages
from shimmy_ros.contract.messages import CODECS
from shimmy_ros.contract.spec import load_contract


def test_a_bag_takes_its_place_at_the_end(tmp_path):
    with new_bag(tmp_path / "deep" / "run", {"a": "1"}) as bag:
        name = bag.add_topic(load_contract().topic("limit_cycle/frequency"), "/x")
        bag.write(name, CODECS["limit_cycle/frequency"].encode(1.0), 7)
        assert not (tmp_path / "deep" / "run").exists()
    assert os.listdir(tmp_path / "deep") == ["run"]
    assert sorted(os.listdir(tmp_path / "deep" / "run")) == ["metadata.yaml", "run_0.mcap"]
    messages = read_messages(tmp_path / "deep" / "run")
    assert len(list(messages)) == 1
    assert messages.metadata["shimmy_ros"] == {"a": "1"}


@pytest.mark.parametrize("error", [BagError, OSError, KeyboardInterrupt])
def test_an_error_leaves_nothing(tmp_path, error):
    def fail_half_way():
        with new_place(tmp_path / "file") as place:
            place.write_text("half")
            raise error

    with pytest.raises(error), new_bag(tmp_path / "run"):
        raise error
    with pytest.raises(error):
        fail_half_way()
    assert os.listdir(tmp_path) == []


def test_what_is_there_stays(tmp_path):
    (tmp_path / "file").write_text("mine")
    for make in (check_new, lambda path: new_place(path).__enter__(),
                 lambda path: new_bag(path).__enter__()):
        with pytest.raises(BagError, match="file exists already and is not overwritten"):
            make(tmp_path / "file")
    # It may have come meanwhile.
    with pytest.raises(BagError, match="exists already"), new_bag(tmp_path / "run"):
        (tmp_path / "run").mkdir()
    assert sorted(os.listdir(tmp_path)) == ["file", "run"]
    assert os.listdir(tmp_path / "run") == []
    with pytest.raises(BagError, match=r"file/run cannot be made: "):
        new_bag(tmp_path / "file" / "run").__enter__()
