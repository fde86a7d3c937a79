"""Judgement of a result: a word with reasons, by common rules for every kind of result.

good
    No objection.
doubtful
    The model may be usable, but a condition does not hold, or too little was measured.
failed
    Not to be used: stated values contradict the recordings, hardly anything was excited, or
    limits are exceeded.

Identifications, models on other recordings, machines with stated limits and findings of a report
are judged alike: by a list of rules, each of which checks the result and returns its objections.
The worst objection is the judgement, followed by the rest. Among equally bad objections the order
of the rules decides: likely causes come before their effects.

The thresholds of all rules are defined here, or at the definition of the bounded figure.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, TypeVar

from pydantic import model_serializer, model_validator
from scipy import special

from checked_files.yaml_file import FileModel
from hil.estimation.free_motion.result import LOOSE
from hil.least_squares.uncertainty import TWICE
from hil.model.drive_train_file import USUAL_BOUND
from hil.show.outcome import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator
    from typing import Self

    from pydantic import SerializerFunctionWrapHandler

    Rule: TypeAlias = "Callable[[S], Reservation | Iterable[Reservation] | None]"

S = TypeVar("S")
Word = Literal["good", "doubtful", "failed"]
WORDS: tuple[Word, ...] = ("good", "doubtful", "failed")
"""Words of a judgement, from best to worst."""

TOLERANCE = USUAL_BOUND
"""Tolerated error or uncertainty of an axis's torque, as a share of the torque.

The uncertainty of a torque constant from a data sheet alone is as large.
"""
NOTABLE = LOOSE
"""Share of an axis's torque, or of its limit, above which a finding gets a remark."""
HALF = 0.5
"""Minimum share of a cause that explains most of a sum of squares."""
INSIDE = float(special.ndtr(TWICE * (2.0**0.5 - 1.0)))
"""Minimum share of samples inside predicted 95 % intervals of sufficient width: 0.79.

Samples of a recording share errors of parameters and of the level of friction. If shared errors are
half of the variance and are at the end of their own 95 % interval, correct intervals contain
Phi(1.96 (sqrt(2) - 1)) of the samples. Without shared errors, intervals too narrow by the factor
`WORSE` contain the same share.
"""
WORSE = float(TWICE / special.ndtri((1.0 + INSIDE) / 2.0))
"""Ratio of the residual to that of the identification above which a model fails: 1.56."""
LARGE = 0.02
"""Torque error on a free motion above which an uncompensated cause is a doubt.

Gears too soft for a compensation (20 Hz) have an effect of this size: docs, causes-of-error.md.
"""
FEWEST = 2
"""Minimum number of measurements per parameter for reliable standard errors: with fewer there are
fewer degrees of freedom than parameters."""

_EARLIER: dict[str, Word] = {"PASS": "good", "WARN": "doubtful", "REFUSE": "failed"}
"""Words of `hil validate` in files of earlier versions."""


class Reservation(FileModel):
    """Objection to a result; with the word good, a note.

    Attributes
    ----------
    word : {"good", "doubtful", "failed"}
        Consequence for the result.
    reason : str
        Reason as a clause.
    remedy : str
        Remedy; empty if nothing is to be done.
    subject : str
        Parameter, axis, measurement or check concerned, if not named in the reason.
    """

    word: Word
    reason: str
    remedy: str = ""
    subject: str = ""

    @model_serializer(mode="wrap")
    def _drop_empty(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {k: v for k, v in write(self).items() if v or k not in ("subject", "further")}

    @property
    def clause(self) -> str:
        """Reason and remedy."""
        return "; ".join(filter(None, (self.reason, self.remedy)))

    def __str__(self) -> str:
        return f"{self.word}: {self.clause}"


class Judgement(Reservation):
    """Judgement of a result: its worst objection, or the reason for a good result.

    Attributes
    ----------
    further : tuple of Reservation
        Further objections to the result, the worst first.
    """

    further: tuple[Reservation, ...] = ()

    @classmethod
    def judge(
        cls, found: Iterable[Reservation], good: Callable[[], Reservation], **more: object
    ) -> Self:
        """Create a judgement from the first of the worst objections; `good` without any.

        Parameters
        ----------
        good : callable
            Function that returns the reason for a good result.
        **more : object
            Further fields of a derived class.
        """
        # Python's sort keeps equally bad ones in order
        first, *rest = sorted(found, key=lambda each: -WORDS.index(each.word)) or [good()]
        own = {name: getattr(first, name) for name in Reservation.model_fields}
        return cls.model_validate({**own, "further": rest, **more})

    @property
    def reasons(self) -> tuple[Reservation, ...]:
        """Objections to the result, the worst first."""
        own = reservation(self.word, self.reason, self.remedy, self.subject)
        return own, *self.further

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Objections to the result, as displayed."""
        first, *further = (Verdict(each.word, each.word, each.clause) for each in self.reasons)
        notes = (Verdict("note", "note", each.text) for each in further if each.kind == "good")
        return first, *(each for each in further if each.kind != "good"), *notes

    @model_validator(mode="before")
    @classmethod
    def _read_earlier_versions(cls, content: Any) -> Any:
        if isinstance(content, dict) and "verdict" in content:
            content = dict(content)
            verdict = content.pop("verdict")
            content["word"] = _EARLIER.get(verdict, verdict)
        return content


class KeptJudgement(Judgement):
    """Judgement of a model on a recording, as kept in the model file.

    Attributes
    ----------
    run : str
        Path of the run's folder, relative to the model's file.
    validated : str
        Time of the validation.
    relative : float
        Residual of all axes together, each relative to its own torque.
    """

    run: str
    validated: str
    relative: float | None


def reservation(word: Word, reason: str, remedy: str = "", subject: str = "") -> Reservation:
    """Return an objection or a note."""
    return Reservation(word=word, reason=reason, remedy=remedy, subject=subject)


good, doubtful, failed = (partial(reservation, word) for word in WORDS)


@dataclass(frozen=True)
class When:
    """Rule with the texts of its objection.

    Attributes
    ----------
    look : callable
        Function of a subject that returns the value of ``{0}`` in `reason`, or a false value if the
        rule does not apply.
    word : {"good", "doubtful", "failed"}
    """

    look: Callable[[Any], object]
    reason: str
    remedy: str = ""
    word: Word = "doubtful"

    def __call__(self, subject: Any) -> Reservation | None:
        """Apply the rule to a subject."""
        found = self.look(subject)
        return reservation(self.word, self.reason.format(found), self.remedy) if found else None


def reservations(rules: Iterable[Rule[S]], subject: S) -> Iterator[Reservation]:
    """Return the objections of all rules to a subject, in the order of the rules."""
    for rule in rules:
        found = rule(subject)
        yield from (found,) if isinstance(found, Reservation) else found or ()
