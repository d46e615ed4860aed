"""The road around the ego: free space, lanes, their direction, and routes; it knows no language."""
