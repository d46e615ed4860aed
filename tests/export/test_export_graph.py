"""What exporters are given answers as the network does, and the card says how pictures are fitted."""

from __future__ import annotations

import json

import cv2
import numpy as np
import pytest
import torch
from made_export import SMALL, THRESHOLDS, fitted_rig, network
from tolerances import assert_rounded

from appocc.camera import Camera, CameraRig
from appocc.export.card import card_text, make_card
from appocc.export.graph import ExportGraph, named_outputs
from appocc.models.input_images import fit_image
from appocc.models.model_spec import MODEL_SPECS
from appocc.models.registry import NETWORKS
from appocc.models.rounding import count_terms
from appocc.rigs import read_rig


@pytest.mark.parametrize("name", NETWORKS)
def test_the_graph_answers_as_the_network(name: str) -> None:
    model, rig = network(name), fitted_rig()
    images = torch.rand(1, len(rig), 3, SMALL.height_px, SMALL.width_px)
    plan = model.plan([rig])
    graph = ExportGraph(model, rig)
    with torch.inference_mode():
        output = model(images, plan)
        expected, found = named_outputs(output.occupancy, output.appearance), graph(images)
    assert found.keys() == expected.keys()
    assert ("appearance" in found) == NETWORKS[name].appearance
    assert torch.equal(graph.seen, plan.seen[0])
    assert expected["occupancy"].std(dim=(2, 3)).min() > 0.02  # else anything would pass
    for key, value in expected.items():
        assert_rounded(found[key], value, count_terms(model), size=1.0)  # answers are 0..1


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
