"""The page of `appocc serve`: recordings, maps, tracks and conversations over HTTP on this machine."""
