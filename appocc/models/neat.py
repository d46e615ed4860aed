"""A neural attention field after NEAT: what is at (x, y) is asked of the pictures' patches, place by place.

Chitta, Prakash and Geiger, "NEAT: Neural Attention Fields for End-to-End Autonomous Driving", ICCV 2021; the paper's
rival in its 180 degree setting (table II). Written from the paper, for occupancy alone: no waypoints, no time, no
speed. What differs, and why:

- Its attention has a place for every patch of three fixed cameras. Here a patch carries its ray and its camera's
  place instead of a learnt number, and a query is compared with each patch: any rig will do, with dead cameras too.
- Places are given as sines and cosines besides numbers: an MLP of plain numbers learns sharp borders only slowly.
- The encoder is EfficientNet-B0 at 1/16, as for the paper's network, in place of ResNet-34.
- It is trained and scored on every cell of the grid. Its published 76.3 (vehicles) is the IoU over 64 points drawn
  for each class, balanced, of a class that holds pedestrians too: no figure over a whole grid compares with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.utils.checkpoint import checkpoint

from appocc.bevmap import CLASSES
from appocc.camera import CameraRig
from appocc.checks import Float32Array
from appocc.errors import ShapeError
from appocc.models.base import BEVModel, Output, Plan
from appocc.models.efficientnet import EfficientNetB0, column_centres_px
from appocc.models.model_spec import Setting
from appocc.models.view_transform.splatting import by_camera, cells_seen, pictures_of_rigs

STRIDE = 16
CHANNELS = 128
_HEADS = 4
_DECODER_BLOCKS = 3
_OCTAVES = 6
# Cells asked at once: what bounds the memory.
_CHUNK = 4096
_RANGE_M = 40.0  # places are given in parts of it


@dataclass(frozen=True, eq=False)
class FieldPlan:
    """Where the patches of a batch's pictures look.

    Attributes:
        rays: (B, N, h, w, 6) float32, ego frame: direction of the patch's ray (unit), place of its camera (metres).
        alive: (B, N) bool, False where a rig has no such camera.
        seen: (B, X, Y) bool, cells that a camera of the rig can see.
        cameras: how many each rig has.
    """

    rays: Tensor
    alive: Tensor
    seen: Tensor
    cameras: tuple[int, ...]

    def to(self, device: torch.device) -> Self:
        """The same on a device."""
        return replace(self, rays=self.rays.to(device), alive=self.alive.to(device), seen=self.seen.to(device))

    def for_export(self) -> Self:
        """Itself: nothing here is hard to translate."""
        return self


class AttentionField(BEVModel):
    """Pictures -> tokens of patches; a place -> attention to them, refined a few times -> occupancy there."""

    places: Tensor

    def __init__(self, setting: Setting, iterations: int = 2) -> None:
        """Make it with fresh weights.

        Args:
            setting: cameras, grid, size of the pictures.
            iterations: of the attention (2 in its paper).
        """
        super().__init__()
        self.setting = setting
        self.iterations = iterations
        self.encoder = EfficientNetB0(STRIDE)
        self.to_tokens = nn.Conv2d(self.encoder.channels[STRIDE], CHANNELS, 1)
        self.of_ray = _mlp(6, CHANNELS)
        # Where to look if no patch knows; and the only token where every camera is dead.
        self.nothing = nn.Parameter(torch.zeros(1, 1, CHANNELS))
        self.mix = _Mixing(CHANNELS)
        places = _waves(torch.from_numpy(setting.grid.centres()).float().reshape(-1, 2) / _RANGE_M)
        self.register_buffer("places", places, persistent=False)  # X*Y 2+4*octaves
        self.query = _mlp(places.shape[1] + CHANNELS, CHANNELS)
        self.decoder = _Decoder(places.shape[1], CHANNELS)

    def plan(self, rigs: Sequence[CameraRig]) -> FieldPlan:
        """Rays of the patches.

        Raises:
            ShapeError: if there are no rigs, or a camera's picture has not the setting's size.
        """
        if not rigs:
            raise ShapeError("plan: expected rigs, got none")
        rays = [_rays(rig, self.setting) for rig in rigs]
        cameras = tuple(map(len, rigs))
        most = max(cameras)
        return FieldPlan(
            rays=torch.from_numpy(np.stack([np.pad(r, [(0, most - len(r)), *[(0, 0)] * 3]) for r in rays])),
            alive=torch.arange(most) < torch.tensor(cameras)[:, None],
            seen=torch.from_numpy(np.stack([cells_seen(rig, self.setting.grid) for rig in rigs])),
            cameras=cameras,
        )

    def forward(self, images: Tensor, plan: Plan) -> Output:
        """Answer a batch, every cell of the grid; nothing is said of the pictures."""
        if not isinstance(plan, FieldPlan):
            raise ShapeError(f"plan: expected one of this network, got {type(plan).__name__}")
        tokens, alive = self._tokens(images, plan)
        chunks = [self._chunk(places, tokens, alive) for places in torch.split(self.places, _CHUNK)]
        logits = torch.cat(chunks, dim=1)  # B X*Y 3
        x, y = self.setting.grid.shape
        return Output(logits.transpose(1, 2).reshape(len(logits), len(CLASSES), x, y), None, None)

    def _tokens(self, images: Tensor, plan: FieldPlan) -> tuple[Tensor, Tensor]:
        """Tokens (B, 1 + T, C) and which of them there are (B, 1, 1, 1 + T)."""
        features = self.to_tokens(self.encoder(pictures_of_rigs(images, plan.cameras))[STRIDE])
        patches = by_camera(features, plan.cameras, plan.alive.shape[1]).permute(0, 1, 3, 4, 2)  # B N h w C
        patches = patches + self.of_ray(plan.rays)
        batch, _, h, w, _ = patches.shape
        tokens = torch.cat([self.nothing.expand(batch, 1, -1), patches.flatten(1, 3)], dim=1)
        alive = functional.pad(plan.alive.repeat_interleave(h * w, dim=1), (1, 0), value=True)[:, None, None]
        return self.mix(tokens, alive), alive

    def _chunk(self, places: Tensor, tokens: Tensor, alive: Tensor) -> Tensor:
        """Logits (B, Q, 3) at places (Q, P); in training their inner values are made again instead of kept."""
        if not self.training:
            return self._asked(places, tokens, alive)
        kept: Tensor = checkpoint(self._asked, places, tokens, alive, use_reentrant=False, preserve_rng_state=False)
        return kept

    def _asked(self, places: Tensor, tokens: Tensor, alive: Tensor) -> Tensor:
        batch = len(tokens)
        where = places.to(tokens.dtype).expand(batch, -1, -1)  # B Q P
        there = (tokens * alive[:, 0, 0, :, None]).sum(1, keepdim=True) / alive.sum(-1)  # B 1 C, mean as a start
        found = there.expand(-1, len(places), -1)
        for _ in range(self.iterations):
            asked = self.query(torch.cat([where, found], dim=-1))  # B Q C
            found = functional.scaled_dot_product_attention(
                asked[:, None], tokens[:, None].to(asked.dtype), tokens[:, None].to(asked.dtype), alive
            )[:, 0]
        logits: Tensor = self.decoder(where, found)
        return logits


class _Mixing(nn.Module):
    """One layer of a transformer: patches of all cameras look at each other."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.before = nn.LayerNorm(channels)
        self.project = nn.Linear(channels, 3 * channels)
        self.out = nn.Linear(channels, channels)
        self.between = nn.LayerNorm(channels)
        self.mlp = _mlp(channels, channels)

    def forward(self, tokens: Tensor, alive: Tensor) -> Tensor:
        batch, count, _ = tokens.shape
        parts = self.project(self.before(tokens)).view(batch, count, 3, _HEADS, -1).permute(2, 0, 3, 1, 4)
        mixed = functional.scaled_dot_product_attention(parts[0], parts[1], parts[2], alive)  # B heads T C/heads
        tokens = tokens + self.out(mixed.transpose(1, 2).reshape(batch, count, -1))
        further: Tensor = tokens + self.mlp(self.between(tokens))
        return further


class _Decoder(nn.Module):
    """Blocks with short cuts from a place to its classes; what was found there joins before each."""

    def __init__(self, channels_in: int, channels: int) -> None:
        super().__init__()
        self.start = nn.Linear(channels_in, channels)
        self.join = nn.ModuleList(nn.Linear(channels, channels) for _ in range(_DECODER_BLOCKS))
        self.blocks = nn.ModuleList(
            nn.Sequential(nn.LayerNorm(channels), *_mlp(channels, channels)) for _ in range(_DECODER_BLOCKS)
        )
        self.end = nn.Linear(channels, len(CLASSES))

    def forward(self, where: Tensor, found: Tensor) -> Tensor:
        x = self.start(where)
        for join, block in zip(self.join, self.blocks, strict=True):
            x = x + join(found)
            x = x + block(x)
        logits: Tensor = self.end(functional.relu(x))
        return logits


def _mlp(channels_in: int, channels_out: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(channels_in, channels_out), nn.ReLU(inplace=True), nn.Linear(channels_out, channels_out)
    )


def _waves(places: Tensor) -> Tensor:
    """(Q, 2 + 4 * octaves): places (Q, 2), and sines and cosines of them, ever finer."""
    angles = [places * math.pi * 2**octave for octave in range(_OCTAVES)]
    return torch.cat([places, *(wave for angle in angles for wave in (angle.sin(), angle.cos()))], dim=1)


def _rays(rig: CameraRig, setting: Setting) -> Float32Array:
    """(N, h, w, 6), see `FieldPlan`."""
    h, w = -(-setting.height_px // STRIDE), -(-setting.width_px // STRIDE)
    pixels = np.stack([*np.meshgrid(column_centres_px(STRIDE, w), column_centres_px(STRIDE, h)), np.ones((h, w))], -1)
    rays = np.empty((len(rig), h, w, 6), dtype=np.float32)
    for i, camera in enumerate(rig):
        if (camera.width_px, camera.height_px) != (setting.width_px, setting.height_px):
            raise ShapeError(
                f"plan, {camera.channel}: expected a picture of {setting.width_px}x{setting.height_px}, "
                f"got {camera.width_px}x{camera.height_px}"
            )
        turn = camera.ego_from_cam[:3, :3] @ np.linalg.inv(camera.intrinsic)
        ahead = pixels @ turn.T
        rays[i, ..., :3] = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
        rays[i, ..., 3:] = camera.ego_from_cam[:3, 3]
    return rays
