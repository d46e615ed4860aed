"""Training: packed datasets, augmentation, losses, the training loop and run folders."""
