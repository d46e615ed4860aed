"""Datasets with their maps in formats of other programs: WebDataset shards and COCO panoptic files."""
