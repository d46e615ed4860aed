"""README of the demo: its files, results and next steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from shlex import quote
from typing import Any

from appocc.demo.dataset import HZ, SCENE, SOURCE, VERSION

CONVERSATION_PICTURE = "conversation.png"
# Maps are also judged within this range, for which the figures of the shipped weights are published.
NEAR_M = 20.0
_TEXT = """\
appocc demo
===========

A car with six cameras and a LiDAR drives for {seconds:.0f} seconds through a simulated town that the network has
never seen. The drive was rendered just now on this machine; no picture was downloaded, nothing was recorded on a
real street.

What each file shows
--------------------
bev.png      Above, the six camera images of key frame {frame}, as one looks out of the car. Below, the same moment
             from above, ahead is up and left is left: on the left what the network makes of the images, on the right
             the truth. First the colour of each cell of 0.4 m, the fainter the less sure the network is, with each
             vehicle in its colour; then what is there (road grey, line markings yellow, vehicles blue). Hatched cells
             are unknown. The green outline is the car itself; the numbers are metres ahead of (+) or behind (-) its
             rear axle.
tracks.webm  The vehicles of the predicted maps followed through all {samples} key frames: the cameras with the
             tracks drawn in, and the map with each vehicle's number, distance, trail and colour. Plays in any
             browser.
tracks.png   Key frame {frame} of it.
{pictures}
             The vehicle that was meant (red), and the place where the car should stand (cyan), in the map and, where
             it is in view and nothing hides it, in the camera that sees the vehicle best. The map is the predicted
             one, the vehicles are the tracks. Where a sentence fits several vehicles, a question comes first; it and
             the reply (>) are below.
{conversation_picture}
             The goal at the end of the conversation below, on the true map.
dataset/     The recording itself, in the nuScenes schema (images, LiDAR sweeps, boxes, vector map), and under bev/
             the maps: {source} (the truth) and predicted, with a picture of each key frame. It is yours to play
             with; nuscenes-devkit opens it as version {version}.

What came out
-------------
maps         {maps}
tracking     {tracking}
{answers}

A conversation (on the true map)
--------------------------------
{conversation}

Hold one yourself with the last line of "Try next": "park behind the white car", "the one on the left", "in front of
it instead", "a bit further", "and then turn right", "where are you heading?", "never mind". The first line opens the
drive in the browser, where you can also talk to it.

Except for the conversation, nothing here looks at the truth, apart from the scores. On the true maps (try --bev
{source} below) tracking and grounding know what to do: what goes wrong above is the network's share. What it was
trained on, and how good it is in other unseen towns (a single drive varies):
appocc weights show

The same by hand
----------------
{steps}

Try next
--------
{next}

Running 'appocc demo' again makes these files anew, and leaves alone whatever else you put into this folder.
"""


def explanation(
    out: Path,
    samples: int,
    frame: int,
    judged: Mapping[str, Any],
    near: Mapping[str, Any],
    scores: Mapping[str, Any],
    answers: Sequence[Mapping[str, Any]],
    conversation: Sequence[Mapping[str, Any]],
) -> str:
    """Return the text of README.txt: what the files in `out` show, the results, and what to try next.

    Args:
        out: folder of the demo.
        samples: number of key frames.
        frame: index of the drawn key frame.
        judged: metrics of the predicted maps (`Evaluation.as_json`).
        near: the same within `NEAR_M`.
        scores: metrics of the tracks.
        answers: answers to the commands, each with `text`, `picture` and `apart_m`, its distance from the answer on
            the true map.
        conversation: answers of a conversation, each with `said` and `text`.
    """
    root, video = quote(str(out / "dataset")), quote(str(out / "tracks.webm"))
    tracks = quote(str(out / "dataset" / "tracks" / "predicted" / SCENE / "tracking.json"))
    asked, command = f"--scene {SCENE} --frame {frame}", answers[0]["query"]["command"]
    steps = [
        f"appocc infer {root} --scene {SCENE} --out {root}/bev/predicted",
        f"appocc eval bev {root} --bev predicted",
        f"appocc track scene {root} --scene {SCENE} --bev predicted --video {video}",
        f'appocc ground "{command}" {root} {asked} --bev predicted --tracks {tracks} --picture ground.png',
    ]
    tries = [
        f"appocc serve {quote(str(out))}",
        f"appocc doctor {root}",
        f"appocc track scene {root} --scene {SCENE} --bev {SOURCE}",
        f'appocc ground "{command}" {root} {asked} --bev {SOURCE} --picture true.png',
        f"appocc groundtruth {root}",
        "appocc simulate town --scenes 2 --seconds 2 --split test --sheet town.png",
        f"appocc ground -i {root} {asked} --bev {SOURCE}",
    ]
    return _TEXT.format(
        samples=samples,
        seconds=(samples - 1) / HZ,
        frame=frame,
        version=VERSION,
        source=SOURCE,
        pictures="\n".join(f'{one["picture"]} "{one["query"]["command"]}"' for one in answers),
        conversation_picture=CONVERSATION_PICTURE,
        conversation="\n".join(_turn(one) for one in conversation),
        maps=_maps(judged, near),
        tracking="MOTA {MOTA:.2f}, IDF1 {IDF1:.2f}, identity switches: {IDS}, annotated boxes: {GT}".format(
            **scores["metrics"]
        ),
        answers="\n".join(_answer(one) for one in answers),
        steps="\n".join(steps),
        next="\n".join(tries),
    )


def _maps(judged: Mapping[str, Any], near: Mapping[str, Any]) -> str:
    within, whole = (
        ", ".join(f"{name} {100 * (iou or 0):.0f}" for name, iou in part["iou_at_threshold"].items())
        for part in (near, judged)
    )
    colours = f"colours off by {near['appearance_l1']:.0f} and {judged['appearance_l1']:.0f} of 255"
    return f"IoU within {NEAR_M:.0f} m: {within} percent; whole map: {whole};\n             {colours}"


def _turn(turn: Mapping[str, Any]) -> str:
    text = turn["text"].replace("\n", "\n  ")
    return f"> {turn['said']}\n  {text}"


def _answer(answer: Mapping[str, Any]) -> str:
    apart = answer["apart_m"]
    text = (
        answer["text"]
        if apart is None
        else f"{answer['text']}\n- {apart:.1f} m from where the true map would have it"
    )
    return "grounding    " + text.replace("\n", "\n             ")
