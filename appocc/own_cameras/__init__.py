"""Recordings of one's own cameras: pictures or videos, a rig and poses; converted, or frame by frame as they come."""
