"""Evaluation of detected objects: nuScenes' detection metric, and vehicles with their headings and paints."""
