"""How good maps are: cells, colours and vehicles compared with the truth, scene by scene."""
