"""Training of the second stage: image crops of predicted vehicles with what is true of them."""
