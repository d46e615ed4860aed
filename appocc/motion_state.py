"""Motion state of a road user by its speed."""

from __future__ import annotations

# Below the first speed an object is standing, above the second moving; between them the state is uncertain.
STANDING_MPS, MOVING_MPS = 0.5, 1.0
