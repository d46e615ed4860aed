"""From pictures to maps: recordings and folders of images, a loaded network, files and pictures for people."""
