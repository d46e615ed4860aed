"""Ground driving commands: sentence -> typed query -> referent in the scene -> one metric goal cell with reasons.

A `Grounder` holds the lexicon and one scene: a bird's-eye-view map with tracks, boxes, or the map's own vehicle
instances. `ground` parses a command, resolves the vehicle that it refers to, and plans the goal pose of the ego.

    from grounding import Grounder

    grounder = Grounder()
    grounder.set_scene(bev, tracks, world_from_ego)
    answer = grounder.ground("park behind the silver car")
    print(answer.text(), answer.target)

Names are imported on first use, so that `grounding.language` starts without the modules of scene and goal.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from appocc.lazy import lazy_exports

if TYPE_CHECKING:
    from grounding.answer import Answer
    from grounding.dialogue.session import Session
    from grounding.goal.planner import Target
    from grounding.grounder import Grounder, GrounderConfig
    from grounding.query import Query
    from grounding.road.style import DrivingStyle

__all__ = ["Answer", "DrivingStyle", "Grounder", "GrounderConfig", "Query", "Session", "Target"]

_MODULES = {
    "Answer": "grounding.answer",
    "DrivingStyle": "grounding.road.style",
    "Grounder": "grounding.grounder",
    "GrounderConfig": "grounding.grounder",
    "Query": "grounding.query",
    "Session": "grounding.dialogue.session",
    "Target": "grounding.goal.planner",
}

if not TYPE_CHECKING:
    __getattr__, __dir__ = lazy_exports(__name__, _MODULES)
