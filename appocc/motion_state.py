"""When a road user stands and when it moves, by its speed."""

from __future__ import annotations

# Slower than the first is standing; faster than the second is moving; between them the state is uncertain.
STANDING_MPS, MOVING_MPS = 0.5, 1.0
