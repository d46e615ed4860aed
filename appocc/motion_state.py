"""Speed thresholds of standing and moving road users."""

from __future__ import annotations

# Below the first a road user stands, above the second it moves; between them its state is uncertain. Above the third
# it drives, and does not creep in a queue.
STANDING_MPS, MOVING_MPS, DRIVING_MPS = 0.5, 1.0, 2.0
