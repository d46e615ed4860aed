"""Bird's-eye views over time: vehicle blobs, tracks by place and colour, and how good they are."""
