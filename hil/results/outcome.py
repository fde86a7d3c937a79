"""What an identification is worth, in one word and one sentence: the first thing that one reads.

good
    Nothing speaks against the parameters.
doubtful
    They may be of use, but something does not hold, or too little was measured.
failed
    They should not be used: what is stated of robot or drives contradicts what was recorded, or
    hardly anything was excited.
"""

from __future__ import annotations

from typing import Literal

from checked_files.yaml_file import FileModel

OutcomeWord = Literal["good", "doubtful", "failed"]
OUTCOME_WORDS: tuple[OutcomeWord, ...] = ("good", "doubtful", "failed")
"""From the best."""


class Outcome(FileModel):
    """What an identification is worth.

    Attributes
    ----------
    word : {"good", "doubtful", "failed"}
    reason : str
        Why, a clause.
    remedy : str
        What to do about it; empty where nothing is to be done.
    """

    word: OutcomeWord
    reason: str
    remedy: str = ""

    def __str__(self) -> str:
        remedy = f"; {self.remedy}" if self.remedy else ""
        return f"{self.word}: {self.reason}{remedy}"
