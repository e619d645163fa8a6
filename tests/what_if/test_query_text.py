"""Queries as text: JSON, the YAML that JSON has a match for, and one sentence for anything else."""

from __future__ import annotations

import json

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from shimmy_ros.what_if.text import LONGEST_TEXT, QueryError, brief, read_mapping

numbers = st.one_of(st.integers(-10**15, 10**15), st.floats(allow_nan=False, allow_infinity=False))
values = st.recursive(
    st.one_of(st.none(), st.booleans(), numbers, st.text(max_size=8)),
    lambda inner: st.one_of(st.lists(inner, max_size=3),
                            st.dictionaries(st.text(max_size=4), inner, max_size=3)), max_leaves=8)
mappings = st.dictionaries(st.text(max_size=8), values, max_size=4)


def refusal(text):
    with pytest.raises(QueryError) as caught:
        read_mapping(text)
    return caught.value


@given(mappings)
def test_json_is_read(content):
    assert read_mapping(json.dumps(content)) == content
    assert read_mapping(json.dumps(content, ensure_ascii=False, indent=1)) == content


@given(st.dictionaries(st.from_regex(r"[a-z_]{1,8}", fullmatch=True),
                       st.one_of(numbers, st.lists(numbers, max_size=3),
                                 st.dictionaries(st.sampled_from(["from", "to"]), numbers)),
                       min_size=1, max_size=4), st.booleans())
def test_yaml_is_read(content, flow):
    assert read_mapping(yaml.safe_dump(content, default_flow_style=flow)) == content


@pytest.mark.parametrize(("text", "value"), [
    ("a: 1e3", 1000.0), ("a: -1.5E-2", -0.015), ("a: .5", 0.5), ("a: +7", 7), ("a: 010", 10),
    ("a: 1:30", "1:30"), ("a: 2020-01-01", "2020-01-01"), ("a: yes", "yes"), ("a: off", "off"),
    ("a: true", True), ("a: null", None), ("a: ~", None), ("a:", None), ("a: 0x10", "0x10"),
    ("a: 1_000", "1_000"), ("a: '1'", "1"), ("a: 2 deg", "2 deg"), ("{a: [1, 2.]}", [1, 2.0]),
    ("# a comment\na: 1\n", 1), ("---\na: 1\n...", 1),
])
def test_yaml_has_the_types_of_json(text, value):
    assert read_mapping(text) == {"a": value}
    assert type(read_mapping(text)["a"]) is type(value)


@pytest.mark.parametrize(("text", "where", "words"), [
    ("", "", "empty"), ("   \n", "", "empty"), ("null", "", "empty"), ("3", "", "is 3, but"),
    ("[1, 2]", "", "[1, 2], but must be a mapping"), ("what if", "", "'what if'"),
    ('{"a": 1', "line 1, column 8", "no JSON: expecting ',' delimiter"),
    ('{"a": 1,\n "b": ]', "line 2, column 7", "no JSON: expecting value"),
    ("{a: 1", "line 1, column 6", "no YAML"), ("a: 1\n b: 2", "line 2, column 3", "no YAML"),
    ("a: [1\nb: 2", "line 2, column 2", "no YAML"),
    ("a: 1\n--- \nb: 2", "line 2, column 1", "YAML"),
    ('{"a": 1, "a": 2}', "a", "'a' is named twice"), ("a: 1\na: 2", "a", "'a' is named twice"),
    ('{"a": {"b": 1, "b": 1}}', "b", "'b' is named twice"),
    ("{a: &x 1, b: *x}", "line 1, column 14", "aliases and tags are not accepted"),
    ("a: !!python/object/apply:os.getcwd []", "line 1, column 4", "tags are not accepted"),
    ("a: !!bool maybe", "line 1, column 4", "tags"), ("a: !x 1", "line 1, column 4", "tags"),
    ("? [1]\n: 2", "line 1, column 3", "a name must be a word"),
    ("a: \x00", "", "no YAML"), ("a: " + "9" * 5000, "", "no YAML"),
    ("[" * 30000, "", "nested too deeply"), ('{"a":' * 15000, "", "nested too deeply"),
    ("x" * (LONGEST_TEXT + 1), "", f"at most {LONGEST_TEXT}"),
])
def test_what_is_no_query_is_refused_with_the_place(text, where, words):
    error = refusal(text)
    assert error.where == where
    assert words in str(error)


@given(st.one_of(st.text(), st.text(alphabet="{}[]:,&*!|>'\"-? \n\tab1.\u2028")))
def test_any_text_is_a_mapping_or_refused_in_one_short_line(text):
    sentence, where = "fine", ""
    try:
        assert isinstance(read_mapping(text), dict)
    except QueryError as error:
        sentence, where = str(error), error.where
    assert 0 < len(sentence) < 400
    assert len(sentence.splitlines()) == 1
    assert len(where) <= 100


def test_a_text_that_would_grow_when_it_is_read_is_refused():
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{chr(98 + n)}: &{chr(98 + n)} [" + ", ".join([f"*{chr(97 + n)}"] * 9) + "]\n"
        for n in range(12))
    assert "aliases" in str(refusal(bomb))


def test_what_is_quoted_is_short():
    for value in ("x" * 10**5, list(range(10**5)), {str(n): [n] * 100 for n in range(100)},
                  10**400, [[[[[[[[1]]]]]]]]):
        assert len(brief(value)) < 200
