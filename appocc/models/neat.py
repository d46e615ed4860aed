"""A neural attention field after NEAT: each query point (x, y) attends to the patches of the images.

Chitta, Prakash and Geiger, "NEAT: Neural Attention Fields for End-to-End Autonomous Driving", ICCV 2021; the paper's
baseline for its 180 degree setting (table II). Written from the NEAT paper, for occupancy only, without waypoints,
time and speed. Differences:

- NEAT learns an embedding for each patch of three fixed cameras. Here the embedding follows from the ray of the patch
  and the position of its camera, so that it works for any rig and with missing cameras.
- Query points also have sine and cosine features: an MLP of plain coordinates learns sharp edges slowly.
- The encoder is EfficientNet-B0 at stride 16, as in the paper's network, instead of ResNet-34.
- It is trained and evaluated on every cell of the grid. NEAT's published 76.3 (vehicles) is the IoU over 64 points
  per class, balanced, and its class includes pedestrians: it is not comparable with an IoU over a grid.
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
from appocc.models.base import BEVModel, ModelOutput, ViewTransformPlan
from appocc.models.efficientnet import EfficientNetB0, column_centres_px
from appocc.models.memory import Past
from appocc.models.model_spec import ModelSpec
from appocc.models.view_transform.splatting import pack_cameras, unpack_cameras, visible_cells

STRIDE = 16
CHANNELS = 128
_HEADS = 4
_DECODER_BLOCKS = 3
_OCTAVES = 6
# Number of query points processed at once; limits the memory.
_CHUNK = 4096
_RANGE_M = 40.0  # unit of the coordinates


@dataclass(frozen=True, eq=False)
class AttentionFieldPlan:
    """Rays of the image patches of a batch.

    Attributes:
        rays: (B, N, h, w, 6) float32, ego frame: unit direction of the ray of a patch, camera position in metres.
        alive: (B, N) bool, False where a rig has no such camera.
        seen: (B, X, Y) bool, cells that a camera of the rig can see.
        cameras: number of cameras of each rig.
    """

    rays: Tensor
    alive: Tensor
    seen: Tensor
    cameras: tuple[int, ...]

    def to(self, device: torch.device) -> Self:
        """Return the plan on a device."""
        return replace(self, rays=self.rays.to(device), alive=self.alive.to(device), seen=self.seen.to(device))

    def for_export(self) -> Self:
        """Return the plan itself: exporters support all operations."""
        return self


class AttentionField(BEVModel):
    """Image patches become tokens; query points attend to them in a few iterations; an MLP decodes occupancy."""

    places: Tensor

    def __init__(self, spec: ModelSpec, iterations: int = 2) -> None:
        """Build the network with random weights.

        Args:
            spec: cameras, grid and image size.
            iterations: number of attention iterations (2 in the NEAT paper).
        """
        super().__init__()
        self.spec = spec
        self.iterations = iterations
        self.encoder = EfficientNetB0(STRIDE)
        self.to_tokens = nn.Conv2d(self.encoder.channels[STRIDE], CHANNELS, 1)
        self.of_ray = _mlp(6, CHANNELS)
        # Token for "no patch is relevant"; the only token if every camera is missing.
        self.nothing = nn.Parameter(torch.zeros(1, 1, CHANNELS))
        self.mix = _Mixing(CHANNELS)
        places = _waves(torch.from_numpy(spec.grid.centres()).float().reshape(-1, 2) / _RANGE_M)
        self.register_buffer("places", places, persistent=False)  # X*Y 2+4*octaves
        self.query = _mlp(places.shape[1] + CHANNELS, CHANNELS)
        self.decoder = _Decoder(places.shape[1], CHANNELS)

    def plan(self, rigs: Sequence[CameraRig]) -> AttentionFieldPlan:
        """Return the rays of the patches of a batch.

        Raises:
            ShapeError: if there are no rigs, or the image size of a camera differs from the model spec.
        """
        if not rigs:
            raise ShapeError("plan: expected rigs, got none")
        rays = [_rays(rig, self.spec) for rig in rigs]
        cameras = tuple(map(len, rigs))
        most = max(cameras)
        return AttentionFieldPlan(
            rays=torch.from_numpy(np.stack([np.pad(r, [(0, most - len(r)), *[(0, 0)] * 3]) for r in rays])),
            alive=torch.arange(most) < torch.tensor(cameras)[:, None],
            seen=torch.from_numpy(np.stack([visible_cells(rig, self.spec.grid) for rig in rigs])),
            cameras=cameras,
        )

    def forward(self, images: Tensor, plan: ViewTransformPlan, past: Past | None = None) -> ModelOutput:
        """Predict the occupancy of every cell, no appearance."""
        if not isinstance(plan, AttentionFieldPlan):
            raise ShapeError(f"plan: expected one of this network, got {type(plan).__name__}")
        tokens, alive = self._tokens(images, plan)
        chunks = [self._chunk(places, tokens, alive) for places in torch.split(self.places, _CHUNK)]
        logits = torch.cat(chunks, dim=1)  # B X*Y 3
        x, y = self.spec.grid.shape
        return ModelOutput(logits.transpose(1, 2).reshape(len(logits), len(CLASSES), x, y), None, None)

    def _tokens(self, images: Tensor, plan: AttentionFieldPlan) -> tuple[Tensor, Tensor]:
        """Return tokens (B, 1 + T, C) and which are valid (B, 1, 1, 1 + T)."""
        features = self.to_tokens(self.encoder(pack_cameras(images, plan.cameras))[STRIDE])
        patches = unpack_cameras(features, plan.cameras, plan.alive.shape[1]).permute(0, 1, 3, 4, 2)  # B N h w C
        patches = patches + self.of_ray(plan.rays)
        batch, _, h, w, _ = patches.shape
        tokens = torch.cat([self.nothing.expand(batch, 1, -1), patches.flatten(1, 3)], dim=1)
        alive = functional.pad(plan.alive.repeat_interleave(h * w, dim=1), (1, 0), value=True)[:, None, None]
        return self.mix(tokens, alive), alive

    def _chunk(self, places: Tensor, tokens: Tensor, alive: Tensor) -> Tensor:
        """Return logits (B, Q, 3) at points (Q, P); training recomputes activations instead of storing them."""
        if not self.training:
            return self._query(places, tokens, alive)
        kept: Tensor = checkpoint(self._query, places, tokens, alive, use_reentrant=False, preserve_rng_state=False)
        return kept

    def _query(self, places: Tensor, tokens: Tensor, alive: Tensor) -> Tensor:
        batch = len(tokens)
        where = places.to(tokens.dtype).expand(batch, -1, -1)  # B Q P
        mean = (tokens * alive[:, 0, 0, :, None]).sum(1, keepdim=True) / alive.sum(-1)  # B 1 C
        found = mean.expand(-1, len(places), -1)
        for _ in range(self.iterations):
            asked = self.query(torch.cat([where, found], dim=-1))  # B Q C
            found = functional.scaled_dot_product_attention(
                asked[:, None], tokens[:, None].to(asked.dtype), tokens[:, None].to(asked.dtype), alive
            )[:, 0]
        logits: Tensor = self.decoder(where, found)
        return logits


class _Mixing(nn.Module):
    """Transformer layer: self-attention over the patches of all cameras."""

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
    """Residual MLP from a query point to class logits; the attended features are added before each block."""

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
    """Return (Q, 2 + 4 * octaves): points (Q, 2) with sines and cosines at rising frequencies."""
    angles = [places * math.pi * 2**octave for octave in range(_OCTAVES)]
    return torch.cat([places, *(wave for angle in angles for wave in (angle.sin(), angle.cos()))], dim=1)


def _rays(rig: CameraRig, spec: ModelSpec) -> Float32Array:
    """Return (N, h, w, 6) rays of the patches, as in `AttentionFieldPlan`."""
    h, w = -(-spec.height_px // STRIDE), -(-spec.width_px // STRIDE)
    pixels = np.stack([*np.meshgrid(column_centres_px(STRIDE, w), column_centres_px(STRIDE, h)), np.ones((h, w))], -1)
    rays = np.empty((len(rig), h, w, 6), dtype=np.float32)
    for i, camera in enumerate(rig):
        if (camera.width_px, camera.height_px) != (spec.width_px, spec.height_px):
            raise ShapeError(
                f"plan, {camera.channel}: expected an image of {spec.width_px}x{spec.height_px}, "
                f"got {camera.width_px}x{camera.height_px}"
            )
        ego_from_pixel = camera.ego_from_cam[:3, :3] @ np.linalg.inv(camera.intrinsic)
        ahead = pixels @ ego_from_pixel.T
        rays[i, ..., :3] = ahead / np.linalg.norm(ahead, axis=-1, keepdims=True)
        rays[i, ..., 3:] = camera.ego_from_cam[:3, 3]
    return rays
