"""Road geometry around the ego: free space, road axis, lanes and shortest paths. It depends on no language."""
