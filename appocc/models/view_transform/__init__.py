"""View transforms: from features of the cameras to the grid."""
