"""The demo's own small scene: a street of plain geometry, no simulator, in the nuScenes schema."""
