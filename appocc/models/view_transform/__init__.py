"""View transforms: from image features to grid features."""
