"""The reader of turns: its features, its file and its training data."""

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file, save_file

from appocc.errors import DataError
from benchmarks.reader.network import TorchReader, export_weights, start_from
from benchmarks.reader.turns import read_patterns, read_turns, turn_example
from grounding.language.reader.fields import ACTS, CHOICES, TURN_CHOICES
from grounding.language.reader.reader import WEIGHTS_PATH
from grounding.language.reader.turns import TURNS_PATH, default_turn_reader, load_turn_reader, turn_rows
from grounding.language.replies import Reply
from grounding.language.syntax.tokenizer import normalise, tokenise


def test_the_state_and_the_patterns_are_the_first_token() -> None:
    tokens = tokenise(normalise("the red one"))
    rows, facts = turn_rows(tokens, "which", Reply(rest="the red one"))
    assert len(rows) == len(facts) == len(tokens) + 1
    assert rows[1:] == turn_rows(tokens, "goal", Reply(("no",), "the red one"))[0][1:]
    assert rows[0] != turn_rows(tokens, "goal", Reply(rest="the red one"))[0][0]
    assert rows[0] != turn_rows(tokens, "which", Reply(("no",), "the red one"))[0][0]


def test_an_oblique_description_is_one_where_a_question_is_open() -> None:
    text = "My knees aren't what they were, so I'd rather have the blue one over there"
    prediction = default_turn_reader().read(tokenise(normalise(text)), "which", Reply(rest=text))
    assert prediction is not None
    assert max(prediction.choices["act"], key=prediction.choices["act"].__getitem__) == "describe"
    assert prediction.choices["colour"]["blue"] > 0.5
    assert default_turn_reader().read([], "which", Reply()) is None


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    good, path = load_file(TURNS_PATH), tmp_path / "turns.safetensors"
    save_file({**good, "rule.act": np.zeros(2, np.float32)}, path)
    with pytest.raises(DataError, match=r"rule.act: expected shape \(3,\), got \(2,\)"):
        load_turn_reader(path)
    with pytest.raises(DataError, match=r"act\.weight"):
        load_turn_reader(WEIGHTS_PATH)


def test_the_network_of_turns_begins_with_that_of_commands() -> None:
    network = TorchReader(TURN_CHOICES, size=64, hidden=128, dropout=0.0, feature_dropout=0.0, word_dropout=0.0)
    commands = {name: array[0] for name, array in load_file(WEIGHTS_PATH).items()}
    start_from(network, commands, tuple(CHOICES))
    weights = export_weights(network)
    for name in ("table", "gru1.backward.state", "relation.weight", "class.bias"):
        np.testing.assert_array_equal(weights[name], commands[name])
    ours, theirs = list(TURN_CHOICES).index("relation"), list(CHOICES).index("relation")
    np.testing.assert_array_equal(weights["attention.weight"][:, ours], commands["attention.weight"][:, theirs])
    assert weights["act.weight"].shape[1] == len(ACTS)
    assert torch.isfinite(network.table.weight).all()


def test_labelled_turns_become_examples() -> None:
    turns = read_turns()
    assert {one.label["act"] for one in turns} == set(ACTS)
    shift = turn_example(next(one.label for one in turns if one.label["act"] == "shift"))
    assert shift is not None
    assert ACTS.index("shift") in shift.right["act"]
    assert shift.right["shift"]
    assert "noun" not in shift.right
    patterns = read_patterns(0)
    assert [one.label["command"] for one in patterns] == [one.label["command"] for one in read_patterns(0)]
