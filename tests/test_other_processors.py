"""The same seed on another processor: the same numbers up to rounding, as docs/conventions.md promises.

Run as a script, this file writes what it computes: in a process whose libraries use the oldest instructions.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from tolerances import assert_rounded

from appocc.models.rounding import count_terms, rounding

TESTS = Path(__file__).parent
OLDEST = {"NUMBA_CPU_NAME": "generic", "ATEN_CPU_CAPABILITY": "default", "ONEDNN_MAX_CPU_ISA": "SSE41"}
CONVENTIONS = TESTS.parent / "docs" / "conventions.md"


def computed() -> dict[str, Any]:
    """A small simulated picture with its depth, and what a network of the same seed answers to noise."""
    from made_render_town import camera, car, town

    from appocc.camera import CameraRig
    from appocc.grid import BEVGrid
    from appocc.models.model_spec import ModelSpec
    from appocc.models.registry import build
    from appocc.simulation.rendering.renderer import Renderer
    from appocc.simulation.rendering.weather import WEATHERS

    front = camera("CAM_FRONT", 96, 64, (1.5, 0.2, 1.5), 0)
    renderer = Renderer(town())
    renderer.set_scene(car(16, -2, 1), np.zeros(4, np.uint8), np.zeros(0, np.uint8), WEATHERS["low_sun"], None)
    view = renderer.views(CameraRig((front,)), np.eye(4), np.random.default_rng(1))["CAM_FRONT"]
    torch.manual_seed(1)
    model = build("appocc", ModelSpec("small", ("CAM_FRONT",), BEVGrid(0.0, 8.0, -4.0, 4.0, 0.5), 96, 64)).eval()
    with torch.inference_mode():
        logits = model(torch.rand(1, 1, 3, 64, 96), model.plan([CameraRig((front,))])).occupancy
    answer = torch.sigmoid(logits).numpy()
    return {"picture": view.image, "depth_m": view.depth_m, "answer": answer, "terms": np.array(count_terms(model))}


@pytest.mark.slow
def test_the_oldest_instructions_give_the_same_up_to_rounding(tmp_path: Path) -> None:
    (share,) = re.findall(r"at least ([\d.]+) % of pixels", CONVENTIONS.read_text())
    subprocess.run(
        [sys.executable, __file__, str(tmp_path / "other.npz")],
        env={**os.environ, **OLDEST, "NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(TESTS.parent)},
        check=True,
    )
    with np.load(tmp_path / "other.npz") as other:
        mine = computed()
        off = np.abs(other["picture"].astype(int) - mine["picture"]).max(axis=-1)
        assert (off <= 1).mean() >= float(share) / 100
        near = np.isclose(other["depth_m"], mine["depth_m"], rtol=rounding(36), atol=0)
        assert near.mean() >= float(share) / 100
        assert_rounded(other["answer"], mine["answer"], int(mine["terms"]), size=1.0)


if __name__ == "__main__":
    np.savez(sys.argv[1], **computed())
