"""Made-up annotated scenes without sensor files, and a detector's noisy results for them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from made_objects import noisy, objects_of_boxes, together

from appocc.files import write_image
from appocc.geometry import inverse, quaternion_from_yaw, transform
from appocc.nuscenes import Dataset, Sample
from appocc.nuscenes.detection_results import ResultBox, result_boxes
from appocc.nuscenes.writer import Annotation, Writer, token_of
from appocc.objects import BEVObjects

VERSION = "v1.0-made"
STEP_US = 500_000
# Category, size (w, l, h), attribute, how many in a scene.
_OBJECTS = (
    ("vehicle.car", (1.8, 4.5, 1.6), "vehicle.moving", 14),
    ("vehicle.car", (1.8, 4.5, 1.6), "vehicle.parked", 10),
    ("vehicle.truck", (2.4, 7.5, 2.8), "", 6),
    ("vehicle.bus.rigid", (2.6, 11.0, 3.2), "vehicle.stopped", 5),
    ("vehicle.motorcycle", (0.8, 2.2, 1.5), "cycle.with_rider", 6),
    ("vehicle.bicycle", (0.6, 1.8, 1.7), "cycle.without_rider", 6),
    ("human.pedestrian.adult", (0.6, 0.6, 1.7), "pedestrian.moving", 8),
    ("vehicle.trailer", (2.5, 8.0, 3.0), "vehicle.parked", 2),
    ("static_object.bicycle_rack", (4.0, 12.0, 1.5), "", 1),
)


def write_annotated(root: Path, scenes: int = 3, samples: int = 4, seed: int = 0) -> Dataset:
    """Scenes of wandering objects up to 60 m around an ego that drives 3 m a key frame."""
    random = np.random.default_rng(seed)
    writer = Writer(root, VERSION)
    # The writer's attributes are those of vehicles.
    writer.add("attribute", token_of("attribute", "pedestrian.moving"), name="pedestrian.moving", description="")
    logs = [token_of("log", number) for number in range(scenes)]
    for number, log in enumerate(logs):
        writer.add("log", log, logfile=str(number), vehicle="", date_captured="", location="here")
        _add_scene(writer, number, log, samples, random)
    writer.add("map", token_of("map"), category="semantic_prior", filename="maps/m.png", log_tokens=logs)
    writer.save()
    write_image(root / "maps" / "m.png", np.full((4, 4), 255, np.uint8))
    return Dataset(root)


def _add_scene(writer: Writer, number: int, log: str, samples: int, random: np.random.Generator) -> None:
    name = f"scene-{number}"
    scene, mount = token_of("scene", name), writer.add_sensor(name, "LIDAR_TOP", np.eye(4))
    tokens = [token_of("sample", name, k) for k in range(samples)]
    turn = quaternion_from_yaw(0.7 * number)
    start = np.array([1000.0 * number, 600.0, 0.0])
    for k, token in enumerate(tokens):
        writer.add("sample", token, timestamp=k * STEP_US, scene_token=scene)
        pose = transform(turn, start + np.array([3.0 * k, 0, 0]))
        writer.add_file(token, "LIDAR_TOP", mount, pose, k * STEP_US, f"samples/{name}-{k}.pcd.bin")
    writer.add_scene(name, "made up", log, tokens)
    kinds = [(row[:3], i) for row in _OBJECTS for i in range(row[3])]
    for (category, size, attribute), i in kinds:
        place, yaw = random.uniform(-42, 42, 2), random.uniform(-np.pi, np.pi)
        speed = random.uniform(0, 4) if attribute.endswith(("moving", "with_rider")) else 0.0
        size_wlh_m = tuple((np.array(size) * random.uniform(0.8, 1.2, 3)).tolist())
        for k, token in enumerate(tokens):
            if random.random() < 0.1:
                continue
            along = place + speed * 0.5 * k * np.array([np.cos(yaw), np.sin(yaw)])
            centre = start + np.array([*along, size[2] / 2])
            annotation = Annotation(
                instance=f"{category}{attribute}{i}",
                category=category,
                world_from_box=transform(quaternion_from_yaw(yaw), centre),
                size_wlh_m=size_wlh_m,
                attribute=attribute,
                lidar_points=int(random.choice([-1, 0, 5, 9])),
            )
            writer.add_annotation(scene, token, annotation)


def all_samples(dataset: Dataset) -> list[Sample]:
    """All key frames in the order of the scenes."""
    return [sample for scene in dataset.scenes for sample in dataset.samples(scene)]


def true_objects(dataset: Dataset, sample: Sample) -> BEVObjects:
    """The annotated boxes of a key frame as a perfect network would predict them."""
    boxes = dataset.boxes_world(sample).transformed(inverse(dataset.world_from_ego(sample)))
    return objects_of_boxes(boxes, np.full((len(boxes), 3), 128.0))


def detected(dataset: Dataset, seed: int = 1, share: float = 0.3, noise: float = 1.0) -> dict[str, list[ResultBox]]:
    """Noisy results for all key frames, some with equal scores and some with the kind of another object."""
    random = np.random.default_rng(seed)
    results = {}
    for sample in all_samples(dataset):
        objects = noisy(true_objects(dataset, sample), random, share, noise)
        swapped = objects.select(np.arange(len(objects)) % 7 == 0)
        kinds = tuple("truck" if kind == "car" else kind for kind in swapped.kind)
        both = together(
            objects.select(np.arange(len(objects)) % 7 != 0),
            BEVObjects(
                centre_m=swapped.centre_m,
                size_wlh_m=swapped.size_wlh_m,
                yaw_rad=swapped.yaw_rad,
                velocity_mps=swapped.velocity_mps,
                kind=kinds,
                rgb=swapped.rgb,
                score=np.round(swapped.score, 1),
            ),
        )
        results[sample.token] = result_boxes(both, dataset.world_from_ego(sample))
    return results
