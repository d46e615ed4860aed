"""Networks from surround pictures to a grid with occupancy and colour; parts are built outside and passed in."""
