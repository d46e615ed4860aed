"""Second stage: crops of a made street, corrections by a made network, and the shipped one on rendered images."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from made_objects import made_object, together
from made_street import BLUE, RED, YAW, Solid, camera, car, photograph
from torch import Tensor

from appocc.bevmap import load_map
from appocc.camera import Camera
from appocc.checks import ByteArray
from appocc.colours import lab_from_rgb
from appocc.geometry import wrap_angle
from appocc.inference.second_stage.image_crops import CROP_HIGH, CROP_WIDE, ImageCrops, crop_images
from appocc.inference.second_stage.network import Corrections, CropInputs, CropNetwork
from appocc.inference.second_stage.refiner import SecondStage, facing_away
from appocc.inference.second_stage.vehicle_paint import paint_from_images
from appocc.nuscenes import Dataset
from appocc.objects import KINDS, BEVObjects
from appocc.training.batches.packed_objects import KIND, RGB, WLH, XY, Z, pack_objects
from appocc.training.batches.packed_objects import YAW as YAW_COLUMN

SIZE_WLH_M = (2.0, 4.0, 1.5)
CPU = torch.device("cpu")


def found(x_m: float, y_m: float, kind: str = "car", yaw_rad: float = 0.0, score: float = 0.9) -> BEVObjects:
    """The object of a made car."""
    return made_object(kind, x_m, y_m, centre_m=[x_m, y_m, 0.75], size_wlh_m=SIZE_WLH_M, yaw_rad=yaw_rad, score=score)


def pictures(solids: list[Solid], channels: tuple[str, ...] = tuple(YAW)) -> ByteArray:
    """Pictures (V, H, W, 3) of solids."""
    cameras = [camera(channel) for channel in channels]
    return np.stack([photograph(one, one.ego_from_cam, solids) for one in cameras])


def cropped(objects: BEVObjects, solids: list[Solid], channels: tuple[str, ...] = tuple(YAW)) -> ImageCrops:
    return crop_images(objects.boxes, pictures(solids, channels), [camera(channel) for channel in channels])


def test_a_crop_shows_the_vehicle_and_where_on_its_box() -> None:
    crops = cropped(found(10, 2), [car(10, 2, RED, "a")])
    assert crops.owner.tolist() == [0]
    on = crops.visible[0] > 0
    assert 0.3 < on.mean() < 0.7  # the projection without the margin
    red = (np.abs(crops.rgb[0].astype(int) - RED) < 12).all(axis=-1)
    assert (red == on).mean() > 0.9
    place = crops.place[0]
    assert np.abs(place[on]).max(axis=-1) == pytest.approx(1.0, abs=1e-6)  # on a face
    assert (place[~on] == 0).all()
    # The camera is behind it to its right: its rear is to the left of its right side, and its roof is below the eye.
    rear, side = on & (place[..., 0] < -0.999), on & (place[..., 1] < -0.999)
    assert rear.any()
    assert side.any()
    assert np.argwhere(rear)[:, 1].mean() < np.argwhere(side)[:, 1].mean()
    heights = [place[row][on[row], 2].mean() for row in range(CROP_HIGH) if on[row].sum() > CROP_WIDE // 4]
    assert (np.diff(heights) < 0).all()


def test_a_vehicle_before_another_hides_it() -> None:
    near, far = (8.0, 0.0), (16.0, 3.0)
    crops = cropped(together(found(*near), found(*far)), [car(*near, BLUE, "b"), car(*far, RED, "r")])
    assert (crops.visible[0] >= 0).all()
    hidden, shown = crops.visible[1] < 0, crops.visible[1] > 0
    assert hidden.any()
    assert shown.any()
    blue = crops.rgb[1][..., 2].astype(int) > crops.rgb[1][..., 0]
    assert blue[hidden].mean() > 0.9
    assert blue[shown].mean() < 0.1


def test_the_camera_that_shows_most_is_taken_and_none_behind() -> None:
    objects = together(found(1, 9), found(-12, 0))
    assert cropped(objects, [], ("CAM_FRONT",)).owner.tolist() == []
    crops = cropped(objects, [car(1, 9, RED, "a"), car(-12, 0, BLUE, "b")])
    assert crops.owner.tolist() == [0, 1]
    assert crops.rgb[0].astype(int)[crops.visible[0] > 0].mean(axis=0).argmax() == 0
    assert crops.rgb[1].astype(int)[crops.visible[1] > 0].mean(axis=0).argmax() == 2


def test_what_is_outside_the_picture_is_black_and_beside_the_camera_cut() -> None:
    crops = cropped(found(3, 2.5), [car(3, 2.5, RED, "a")], ("CAM_FRONT",))
    assert crops.owner.tolist() == [0]
    assert np.isfinite(crops.place).all()
    assert (crops.rgb[0] == 0).all(axis=-1).any()
    assert (crops.size_px <= 2 * np.array([320, 180])).all()


@pytest.mark.parametrize("yaw_rad", [0.0, 3.0, -1.4, 1.7])
def test_headings_point_away_from_the_ego(yaw_rad: float) -> None:
    boxes, away = facing_away(found(5, -12, yaw_rad=yaw_rad))
    bearing = np.arctan2(-12, 5)
    assert np.cos(boxes.yaw_rad - bearing)[0] >= 0
    turned = np.abs(wrap_angle(boxes.yaw_rad - yaw_rad))[0]
    assert turned == pytest.approx(0.0 if away[0] > 0 else np.pi, abs=1e-9)


class _Says(CropNetwork):
    """A network that says the same of every box."""

    def __init__(self, near_front: float = -9.0, kind: str = "car", score: float = 0.5) -> None:
        super().__init__()
        self.logits = (float(np.log(score / (1 - score))), near_front)
        self.kind = kind

    def forward(self, inputs: CropInputs) -> Corrections:
        def every(*values: float) -> Tensor:
            return torch.tensor(values).expand(len(inputs.numbers), len(values))

        kinds = [5.0 if kind == "pedestrian" else 4.0 if kind == self.kind else 0.0 for kind in KINDS]
        found, near = (every(logit)[:, 0] for logit in self.logits)
        lab = every(*lab_from_rgb(np.array(BLUE)).tolist())
        return Corrections(found, near, every(*kinds), lab, every(0.0, float(np.log(1.5)), 0.0))


PICTURES, CAMERAS = pictures([]).transpose(0, 3, 1, 2), [camera(channel) for channel in YAW]


def refined(network: CropNetwork, objects: BEVObjects) -> BEVObjects:
    return SecondStage(network, CPU)(objects, PICTURES, CAMERAS)


def test_corrections_are_those_of_the_network() -> None:
    before = found(10, 2, yaw_rad=0.2)
    after = refined(_Says(near_front=9.0, kind="truck", score=0.7), before)
    assert after.kind == ("truck",)  # never a person
    assert after.score[0] == pytest.approx(0.7, abs=1e-6)
    assert wrap_angle(after.yaw_rad - (0.2 + np.pi))[0] == pytest.approx(0, abs=1e-6)
    assert after.size_wlh_m[0] == pytest.approx([2.0, 6.0, 1.5], rel=1e-6)
    own = paint_from_images(before, PICTURES, CAMERAS).rgb
    assert lab_from_rgb(after.rgb)[0] == pytest.approx(
        (lab_from_rgb(own)[0] + lab_from_rgb(np.array(BLUE))) / 2, abs=0.01
    )
    np.testing.assert_array_equal(after.centre_m, before.centre_m)
    oncoming = refined(_Says(near_front=-9.0), found(10, 2, yaw_rad=3.1))
    assert wrap_angle(oncoming.yaw_rad - (3.1 + np.pi))[0] == pytest.approx(0, abs=1e-6)


def test_people_and_unlikely_vehicles_stay_and_the_best_comes_first() -> None:
    objects = together(found(10, 2), found(20, 2, "pedestrian", score=0.7), found(30, 3, score=0.05))
    after = refined(_Says(kind="bus", score=0.3), objects)
    assert after.kind == ("pedestrian", "bus", "car")
    assert after.score == pytest.approx([0.7, 0.3, 0.05], abs=1e-6)
    np.testing.assert_array_equal(after.rgb[[0, 2]], objects.rgb[1:])
    assert len(refined(_Says(), found(20, 2, "pedestrian"))) == 1
    assert len(refined(_Says(), objects.select(np.zeros(3, np.bool_)))) == 0


def _true_objects(root: Path) -> list[tuple[BEVObjects, ByteArray, list[Camera]]]:
    """Vehicles of rendered frames within 25 m, as true as their annotations."""
    dataset, frames = Dataset(root), []
    for scene in dataset.scenes:
        sample = dataset.samples(scene)[0]
        frame = dataset.frame(sample)
        assert frame.boxes_ego is not None
        rows, _ = pack_objects(frame.boxes_ego, load_map(root, "exact", sample.token))
        near = (np.hypot(*rows[:, XY].T) < 25) & (rows[:, KIND] == 0) & np.isfinite(rows[:, RGB]).all(axis=1)
        rows = rows[near]
        objects = BEVObjects(
            centre_m=rows[:, [*range(XY.start, XY.stop), Z]],
            size_wlh_m=rows[:, WLH],
            yaw_rad=rows[:, YAW_COLUMN],
            velocity_mps=np.zeros((len(rows), 2)),
            kind=("car",) * len(rows),
            rgb=rows[:, RGB],
            score=np.full(len(rows), 0.9),
        )
        frames.append((objects, np.stack([*frame.images.values()]).transpose(0, 3, 1, 2), list(frame.rig)))
    return frames


def test_the_shipped_network_turns_vehicles_that_face_the_wrong_way(simulated_root: Path) -> None:
    stage, right, paints = SecondStage.shipped(CPU), [], []
    for truth, images, cameras in _true_objects(simulated_root):
        wrong = replace(truth, yaw_rad=truth.yaw_rad + np.pi, rgb=np.full_like(truth.rgb, np.nan))
        after = stage(wrong, images, cameras)
        order = [int(np.hypot(*(after.centre_m - centre).T[:2]).argmin()) for centre in truth.centre_m]
        shown = np.isfinite(after.rgb[order]).all(axis=1)
        right += (np.abs(wrap_angle(after.yaw_rad[order] - truth.yaw_rad)) < 0.5)[shown].tolist()
        apart = np.linalg.norm(lab_from_rgb(after.rgb[order]) - lab_from_rgb(truth.rgb), axis=1)
        paints += apart[shown].tolist()
    assert len(right) > 20
    assert np.mean(right) > 0.6
    assert np.median(paints) < 20
