"""Demo: a simulated drive, its predicted maps, tracks and grounded commands, explained."""
