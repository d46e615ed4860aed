"""What exporters are given answers as the network does, and the card says how pictures are fitted."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
import torch
from made_export import ALL_PARTS, THRESHOLDS, fitted_rig, network
from tolerances import assert_rounded

from appocc.camera import Camera, CameraRig
from appocc.export.card import card_text, make_card
from appocc.export.clips import synthetic_clips
from appocc.export.graph import ExportGraph, named_outputs, run_network
from appocc.models.input_images import fit_image
from appocc.models.model_spec import MODEL_SPECS, Parts
from appocc.models.registry import NETWORKS
from appocc.models.rounding import count_terms
from appocc.rigs import read_rig


@pytest.mark.parametrize(("name", "parts"), [*((name, Parts()) for name in NETWORKS), ("appocc", ALL_PARTS)])
def test_the_graph_answers_as_the_network(name: str, parts: Parts) -> None:
    model, rig = network(name, parts=parts), fitted_rig()
    plan = model.plan([rig])
    graph = ExportGraph(model, rig)
    inputs = {key: torch.from_numpy(value) for key, value in synthetic_clips(graph.shapes, 3)["noise"][0].items()}
    with torch.inference_mode():
        expected, found = run_network(model, plan, inputs), graph(*(inputs[key] for key in graph.shapes))
    assert found.keys() == expected.keys()
    assert ("appearance" in found) == NETWORKS[name].appearance
    assert ("object_box" in found) == ("next_memory" in found) == (parts == ALL_PARTS)
    assert torch.equal(graph.seen, plan.seen[0])
    assert expected["occupancy"].std(dim=(2, 3)).min() > 0.02  # else anything would pass
    for key, value in expected.items():
        # Answers are 0..1, but for boxes and memory.
        assert_rounded(found[key], value, count_terms(model), size=max(1.0, float(value.abs().max())))


def test_nothing_as_memory_is_a_first_frame() -> None:
    model, rig = network("appocc", parts=ALL_PARTS), fitted_rig()
    graph = ExportGraph(model, rig)
    clips = synthetic_clips(graph.shapes)
    (patches, *_), (noise, *_) = clips["patches"], clips["noise"]
    assert not patches["memory"].any()
    assert noise["memory"].any()
    with torch.inference_mode():
        first = named_outputs(model(torch.from_numpy(patches["images"]), model.plan([rig])))
        found = graph(*(torch.from_numpy(patches[key]) for key in graph.shapes))
        other = graph(*(torch.from_numpy({**patches, "memory": noise["memory"]}[key]) for key in graph.shapes))
    for key, value in first.items():
        assert_rounded(found[key], value, count_terms(model), size=max(1.0, float(value.abs().max())))
        assert (found[key] - other[key]).abs().max() > 1e-3, key


def test_pictures_fitted_by_the_card_are_those_of_the_network() -> None:
    front = read_rig("paper_full")["CAM_FRONT"]
    odd = Camera("CAM_ODD", 640, 480, np.array([[500.0, 0, 310], [0, 480, 250], [0, 0, 1]]), front.ego_from_cam)
    small = Camera("CAM_SMALL", 200, 150, np.array([[150.0, 0, 99], [0, 150, 80], [0, 0, 1]]), front.ego_from_cam)
    same = read_rig("paper")["CAM_BACK"]
    rig = CameraRig((front, odd, small, same))
    spec = MODEL_SPECS["360"]
    values = {"network": "lss", "thresholds": THRESHOLDS, "appearance": "false"}
    card = json.loads(card_text(make_card(values, {}, spec, rig, "mixed", ("numpy",))))
    draw = np.random.default_rng(0)
    for camera, entry in zip(rig, card["cameras"], strict=True):
        image = draw.integers(0, 255, (camera.height_px, camera.width_px, 3), np.uint8)
        expected, fit = fit_image(image, camera, spec)
        whole = cv2.resize(image, entry["resize_px"], interpolation=getattr(cv2, entry["interpolation"]))
        left, top, width, height = entry["crop_px"]
        assert np.array_equal(whole[top : top + height, left : left + width], expected), camera.channel
        assert np.array_equal(entry["intrinsic"], fit.intrinsic)
        assert np.array_equal(entry["ego_from_cam"], camera.ego_from_cam)
    assert card["thresholds"] == {"road": 0.5, "vehicle": 0.4, "lane": 0.3}
    assert set(card["outputs"]) == {"occupancy", "seen"}
    assert card["versions"]["numpy"] == np.__version__
