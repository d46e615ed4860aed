"""Batches of training samples: reading and packing, augmentation, loading, copying to the device."""
