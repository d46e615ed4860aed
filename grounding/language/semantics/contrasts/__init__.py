"""Contrasts and self-repairs: rewrite "not X, Y" and "X, no, Y" to forms without a reparandum.

The tagged tokens of a text become a string with one letter for each category. Regular expressions over these
letters are the grammar of contrasts. Each rule replaces the tokens of its match; the first rule that matches is
applied until none does. The terms are those of Shriberg (1994), "Preliminaries to a Theory of Speech Disfluencies":
the *repair* replaces the *reparandum* before the *editing term* ("no", "i mean").
"""
