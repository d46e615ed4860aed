"""Evaluation of BEV maps: cells, colours and vehicles compared with the true maps, scene by scene."""
