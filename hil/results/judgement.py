"""What a result is worth, in one word and the reasons for it: one judgement for all that is judged.

good
    Nothing speaks against it.
doubtful
    It may be of use, but something does not hold, or too little was measured.
failed
    It should not be used: what is stated contradicts what was recorded, hardly anything was
    excited, or limits are exceeded.

An identification, a model on another recording, a machine beside its limits and the findings of a
report are judged alike: by a list of rules, each of which has a look and answers with what speaks
against the result, if anything does. The worst of that is the judgement, the rest stands behind it.
Where several are equally bad the rules' order decides: likely causes come before their effects.

The thresholds of all rules stand here, each once, or where the figure that they bound is defined.
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
"""From the best."""

TOLERANCE = USUAL_BOUND
"""Share of an axis's torque by which it may be off or uncertain.

As much as its torque constant by itself leaves open, so that data sheets promise no more.
"""
NOTABLE = LOOSE
"""Share of an axis's torque, or of its limit, from which on a finding is worth a remark."""
HALF = 0.5
"""Share of a sum of squares: what explains less than half of one explains next to nothing."""
INSIDE = float(special.ndtr(TWICE * (2.0**0.5 - 1.0)))
"""Share of samples inside predicted intervals of 95 % below which these are too narrow: 0.79.

Samples of one recording share errors of parameters and of friction's level. Where these are half of
the variance and at the end of an interval of 95 % of their own, right intervals hold Phi(1.96
(sqrt(2) - 1)) of the samples; errors `WORSE` times those stated, without any shared, as many.
"""
WORSE = float(TWICE / special.ndtri((1.0 + INSIDE) / 2.0))
"""Residual over that of the identification from which on a model does not generalise: 1.56."""
LARGE = 0.02
"""Error of the torques on a free motion from which on a cause that is not accounted for is a doubt.

Gears too soft to be accounted for show with as much (20 Hz, docs, causes-of-error.md).
"""
FEWEST = 2
"""Measurements for each parameter below which errors are not known well enough to be stated: with
fewer there are not as many degrees of freedom as parameters."""

_EARLIER: dict[str, Word] = {"PASS": "good", "WARN": "doubtful", "REFUSE": "failed"}
"""Words of `hil validate` in files of earlier versions."""


class Reservation(FileModel):
    """What speaks against a result; where the word is good, a note beside it.

    Attributes
    ----------
    word : {"good", "doubtful", "failed"}
        What it makes of the result.
    reason : str
        Why, a clause.
    remedy : str
        What to do about it; empty where nothing is to be done.
    subject : str
        Parameter, axis, measurement or check that it concerns, where the reason does not name it.
    """

    word: Word
    reason: str
    remedy: str = ""
    subject: str = ""

    @model_serializer(mode="wrap")
    def _without_empty(self, write: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {k: v for k, v in write(self).items() if v or k not in ("subject", "further")}

    @property
    def clause(self) -> str:
        """Reason and remedy."""
        return "; ".join(filter(None, (self.reason, self.remedy)))

    def __str__(self) -> str:
        return f"{self.word}: {self.clause}"


class Judgement(Reservation):
    """What a result is worth: the worst of what speaks against it, or why nothing does.

    Attributes
    ----------
    further : tuple of Reservation
        All else that speaks against it, the worst first.
    """

    further: tuple[Reservation, ...] = ()

    @classmethod
    def of(
        cls, found: Iterable[Reservation], good: Callable[[], Reservation], **more: object
    ) -> Self:
        """Take the worst of what was found, the first of equally bad ones; `good` if nothing was.

        Parameters
        ----------
        found : iterable of Reservation
        good : callable
            States why the result is good.
        **more : object
            Further fields of a class that has some.
        """
        # Python's sort keeps equally bad ones in order
        first, *rest = sorted(found, key=lambda each: -WORDS.index(each.word)) or [good()]
        own = {name: getattr(first, name) for name in Reservation.model_fields}
        return cls.model_validate({**own, "further": rest, **more})

    @property
    def reasons(self) -> tuple[Reservation, ...]:
        """All that speaks against the result, the worst first."""
        own = reservation(self.word, self.reason, self.remedy, self.subject)
        return own, *self.further

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """The same as they are shown."""
        return tuple(Verdict(each.word, each.word, each.clause) for each in self.reasons)

    @model_validator(mode="before")
    @classmethod
    def _of_earlier_versions(cls, content: Any) -> Any:
        if isinstance(content, dict) and "verdict" in content:
            content = dict(content)
            verdict = content.pop("verdict")
            content["word"] = _EARLIER.get(verdict, verdict)
        return content


class KeptJudgement(Judgement):
    """What a model was worth on one recording, as its file keeps it.

    Attributes
    ----------
    run : str
        Path of the run's folder, from that of the model's file.
    validated : str
        When.
    relative : float
        Residual of all axes together over their torque, each as a share of its own.
    """

    run: str
    validated: str
    relative: float | None


def reservation(word: Word, reason: str, remedy: str = "", subject: str = "") -> Reservation:
    """Return what makes a result so good or bad."""
    return Reservation(word=word, reason=reason, remedy=remedy, subject=subject)


good, doubtful, failed = (partial(reservation, word) for word in WORDS)


@dataclass(frozen=True)
class When:
    """A rule as data.

    Attributes
    ----------
    look : callable
        Returns of a subject what `reason` is filled with, as ``{0}``; something false where the
        rule does not apply.
    reason, remedy : str
    word : {"good", "doubtful", "failed"}
    """

    look: Callable[[Any], object]
    reason: str
    remedy: str = ""
    word: Word = "doubtful"

    def __call__(self, subject: Any) -> Reservation | None:
        """Look at a subject."""
        found = self.look(subject)
        return reservation(self.word, self.reason.format(found), self.remedy) if found else None


def reservations(rules: Iterable[Rule[S]], subject: S) -> Iterator[Reservation]:
    """Have each rule look at a subject; all that they find, in their order."""
    for rule in rules:
        found = rule(subject)
        yield from (found,) if isinstance(found, Reservation) else found or ()
