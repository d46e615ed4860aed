"""Second stage: a small network looks at the image of each predicted vehicle and corrects its box, kind and paint."""
