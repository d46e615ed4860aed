"""Files of detections and tracks: nuScenes, KITTI and MOTChallenge formats."""
