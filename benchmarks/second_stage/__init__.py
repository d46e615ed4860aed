"""Training of the second stage: image crops of predicted vehicles, and colours of cells, with their truth."""
