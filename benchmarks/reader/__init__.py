"""Training of the reader network of `grounding.language.reader`: sentences, variants, network and rule."""
