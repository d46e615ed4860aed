"""The network of the package: its file, its probabilities, and its torch twin."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file, save_file

from appocc.errors import DataError
from benchmarks.reader.examples import Example, example_of, read_sentences
from benchmarks.reader.network import TorchReader, batch_of, export_weights, stacked
from benchmarks.reader.training import loss_of
from benchmarks.reader.variants import Variants
from grounding.language.reader.fields import CHOICES
from grounding.language.reader.network import MAX_TOKENS, ReaderNetwork
from grounding.language.reader.reader import WEIGHTS_PATH, default_reader, load_reader
from grounding.language.reader.revision import Evidence
from grounding.language.syntax.tokenizer import normalise, tokenise
from grounding.query import Query

SENTENCES = ["pull in behind the dark blue van", "bus", "not the red one, the lorry on the left, go past that"]


@pytest.fixture
def weights(tmp_path: Path) -> Path:
    return Path(shutil.copy(WEIGHTS_PATH, tmp_path / "reader.safetensors"))


def test_probabilities() -> None:
    prediction = default_reader().network.predict(tokenise(normalise(SENTENCES[0])))
    for shares in prediction.choices.values():
        assert sum(shares.values()) == pytest.approx(1, abs=1e-4)
    assert set(prediction.choices["colour"]) == {"none", "dark blue"}
    assert all(0 <= one <= 1 for one in prediction.qualifiers.values())
    assert prediction.choices["noun"]["van"] > 0.9
    assert prediction.head == "van"


def test_a_long_text_is_left_to_the_grammar() -> None:
    query = Query("x", "park", ("park",))
    for tokens in ((), tokenise("stop " * (MAX_TOKENS + 1))):
        assert default_reader().revise(query, Evidence(), tokens) is None


def test_damaged_weights_are_reported(weights: Path) -> None:
    whole, good = weights.read_bytes(), load_file(weights)
    for content in (b"", whole[:1000], whole[:-1], b"no weights"):
        weights.write_bytes(content)
        with pytest.raises(DataError, match=f"{weights}: no weights of the reader"):
            load_reader(weights)
    weights.unlink()
    with pytest.raises(DataError, match=f"{weights}: cannot be read"):
        load_reader(weights)
    for name, array, reason in (
        ("table", good["table"][:, 1:], r"table: expected shape \(2, 8192, 64\)"),
        ("rule.status", good["rule.status"][1:], r"rule.status: expected shape \(9,\)"),
        ("point.bias", good["point.bias"] * np.float16(np.nan), "point.bias: expected finite numbers"),
    ):
        save_file({**good, name: array}, weights)
        with pytest.raises(DataError, match=reason):
            load_reader(weights)
    save_file({name: array for name, array in good.items() if name != "gru1.forward.state"}, weights)
    with pytest.raises(DataError, match=r"gru1.forward.state: expected shape .*, got None"):
        load_reader(weights)


def examples() -> list[Example]:
    labels = [one.label for one in read_sentences()[:24]]
    return [one for one in map(example_of, labels) if one is not None]


def test_the_networks_in_numpy_are_those_in_torch_and_their_mean_is_returned() -> None:
    torch.manual_seed(1)
    sizes: dict[str, Any] = {"size": 8, "hidden": 6, "dropout": 0.2, "feature_dropout": 0.1, "word_dropout": 0.1}
    networks = [TorchReader(CHOICES, **sizes).eval() for _ in range(3)]
    for value in (one for network in networks for one in network.parameters()):
        value.data = value.data.half().float()
    chosen = examples()
    batch = batch_of([(one.rows, one.facts) for one in chosen])
    outputs = [network(batch) for network in networks]
    found = {field: torch.stack([one[field].exp() for one in outputs]).mean(0).detach() for field in outputs[0]}
    odds = torch.stack([torch.sigmoid(one["tag"]) for one in outputs]).mean(0).detach()
    ensemble = ReaderNetwork(stacked([export_weights(network) for network in networks]))
    for i, one in enumerate(chosen):
        prediction = ensemble.predict_rows(one.rows, one.facts)
        for field, shares in prediction.choices.items():
            if field != "colour":
                np.testing.assert_allclose(list(shares.values()), found[field][i], atol=1e-5)
        assert prediction.choices["colour"]["none"] == pytest.approx(found["colour"][i, 0].item(), abs=1e-5)
        tags = [*prediction.qualifiers.values(), *prediction.actions.values()]
        np.testing.assert_allclose(tags, odds[i], atol=1e-5)


def test_training_lowers_the_loss() -> None:
    torch.manual_seed(1)
    network, chosen = (
        TorchReader(CHOICES, size=8, hidden=6, dropout=0.0, feature_dropout=0.0, word_dropout=0.0),
        examples(),
    )
    optimiser = torch.optim.AdamW(network.parameters(), 0.02)
    losses = []
    for _ in range(12):
        loss = loss_of(network(batch_of([(one.rows, one.facts) for one in chosen])), chosen)
        optimiser.zero_grad()
        torch.autograd.backward(loss)
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < 0.6 * losses[0]


def test_variants_keep_or_change_the_label_with_the_words() -> None:
    label: dict[str, Any] = {
        "command": "turn left behind the red van",
        "status": "ok",
        "action": "turn",
        "direction": "left",
        "relation": "behind",
        "referent": {"noun": "van", "noun_alt": [], "head": "van", "colour": "red", "qualifiers": []},
        **dict.fromkeys(("goal_side", "landmark", "trigger")),
        **{key: [] for key in ("action_alt", "actions", "relation_alt", "secondary", "excluded")},
    }
    variants = Variants([], seed=3)
    drawn = [one for one in (variants.draw(label) for _ in range(200)) if one is not None]
    assert len({one["command"] for one in drawn}) > 60
    for one in drawn:
        reported = one["status"] == "reject"
        assert reported == (one["referent"] is None)
        if not reported:
            assert one["referent"]["colour"] in one["command"].lower()
            # A turn that is forbidden has no direction.
            assert (one["direction"] in ("left", "right")) == (one["action"] == "turn")
    assert {"left", "right"} <= {one["direction"] for one in drawn}
