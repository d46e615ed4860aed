"""Language: from the words of a command to a typed query.

Example:
    reading = parse("park behind the silver car")
    reading.query.action, reading.query.relation  # "park", "behind"
"""

from grounding.language.ambiguity import MAX_READINGS
from grounding.language.parser import parse, parse_all
from grounding.language.problems import CommandError, ParseProblem, underline
from grounding.language.reading import Reading
from grounding.language.syntax.lexicon import Lexicon, default_lexicon, read_lexicon
from grounding.language.syntax.tokenizer import MAX_CHARACTERS, Token
from grounding.language.syntax.word_categories import WordCategory

__all__ = [
    "MAX_CHARACTERS",
    "MAX_READINGS",
    "CommandError",
    "Lexicon",
    "ParseProblem",
    "Reading",
    "Token",
    "WordCategory",
    "default_lexicon",
    "parse",
    "parse_all",
    "read_lexicon",
    "underline",
]
