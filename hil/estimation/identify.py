"""Select the identification method by name, or by the kinds of the recordings.

Two-step methods take measurements (`two_step_methods`), the others imported motions
(`import_methods`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from hil.errors import Mismatch, UnknownName
from hil.estimation.back_and_forth import NAME as BACK_AND_FORTH
from hil.estimation.back_and_forth import goes_back_and_forth
from hil.estimation.free_motion.variants import DEFAULT, VARIANTS
from hil.estimation.options import COVARIANCES, DEFAULTS, NUISANCES
from hil.estimation.two_step_methods import fit_improved, fit_published
from hil.friction.terms import LAWS
from hil.planning.free_motion import FreeMotion

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hil.estimation.estimate import Estimate
    from hil.estimation.options import Options
    from hil.model.robot import Robot
    from hil.planning.measurement import RecordedMotion
    from hil.runs.recording import Recorded

    Identify = Callable[[Robot, Recorded, Options], Estimate]


JOINT = "joint"
"""Name of the method for recordings of several kinds."""


def _import_method(name: str) -> Identify:
    def identify(robot: Robot, recorded: Recorded, options: Options) -> Estimate:
        # spectra and filters take half a second to import, and measurements do not use them
        from hil.estimation import import_methods as methods  # noqa: PLC0415

        if name == JOINT:
            return methods.fit_joint(robot, recorded, options)
        if name == BACK_AND_FORTH:
            # friction is estimated without a law, and gears are rigid
            return methods.fit_back_and_forth(robot, recorded, options.covariance)
        return methods.fit_free_motions(robot, recorded, name, options)

    return identify


METHODS: dict[str, Identify] = {
    "improved": fit_improved,
    "published": fit_published,
    **{name: _import_method(name) for name in (JOINT, BACK_AND_FORTH, *VARIANTS)},
}
"""Methods by name: two-step methods, the method for recordings of several kinds, and methods for
imported motions."""


class Effective(NamedTuple):
    """Option values with an effect on a method; names as in `Options`."""

    friction: tuple[str, ...] = ("auto",)
    nuisance: tuple[str, ...] = ()
    covariance: tuple[str, ...] = ("jackknife",)


EFFECTIVE = {
    "improved": Effective(nuisance=("lag", "compliance"), covariance=COVARIANCES),
    JOINT: Effective(("auto", *LAWS), NUISANCES, COVARIANCES),
    BACK_AND_FORTH: Effective(covariance=COVARIANCES),
    DEFAULT: Effective(("auto", *LAWS), NUISANCES, COVARIANCES),
}
"""Effective option values by method; the default for methods not listed is that of `Effective`."""
RIVALS = (
    "methods for comparison run from the repository: python -m benchmarks.rivals RUN --method NAME"
)
"""Hint to methods of earlier versions, kept for comparison only."""


def default_method(motions: Sequence[RecordedMotion]) -> tuple[str, str]:
    """Return the default method for measurements or recorded motions, with the reason."""
    free = sum(isinstance(motion, FreeMotion) for motion in motions)
    alone = sum(map(goes_back_and_forth, motions))
    unknown = any(isinstance(each, FreeMotion) and each.unknown_gains for each in motions)
    if motions and alone == len(motions) and not unknown:
        return BACK_AND_FORTH, "all recordings are strokes of a single axis"
    if motions and free == len(motions):
        reason = "all recordings are imported"
        if alone and not unknown:
            reason += (
                f"; for {alone} recordings with strokes of a single axis, --method "
                f"'{BACK_AND_FORTH}' estimates friction without a friction law"
            )
        return DEFAULT, reason
    if free:
        return JOINT, (
            f"{len(motions) - free} of {len(motions)} recordings were measured by hil run"
        )
    return "improved", "all recordings were measured by hil run"


def estimate(
    robot: Robot, recorded: Recorded, method: str = "improved", options: Options = DEFAULTS
) -> Estimate:
    """Identify the base parameters of `robot`.

    Parameters
    ----------
    recorded : iterable of (RecordedMotion, Recording)
    method : str
        One of `METHODS`.

    Raises
    ------
    UnknownName
        The method does not exist.
    NotIdentifiable
        Base parameters are not excited by the measurements.
    NotEnoughData
        A method for free motions without free motions.
    Mismatch
        See `refuse_without_effect`.
    """
    refuse_without_effect(method, options)
    return METHODS[method](robot, recorded, options)


def restrict(method: str, options: Options) -> Options:
    """Return options without friction laws and nuisances that have no effect on a method."""
    friction, nuisance, _ = EFFECTIVE[method]
    return replace(
        options,
        friction=options.friction if options.friction in friction else DEFAULTS.friction,
        nuisance=tuple(name for name in options.nuisance if name in nuisance),
    )


def refuse_without_effect(method: str, options: Options) -> None:
    """Raise an error for options without effect on a method.

    Raises
    ------
    UnknownName
        The method does not exist, or accepts no prior.
    Mismatch
        Friction, nuisance or covariance without effect; the message lists effective values.
    """
    if options.prior is not None and method in (BACK_AND_FORTH, "published"):
        raise UnknownName(
            f"method {method!r}: takes no prior; omit --prior, or use --method improved, or "
            f"'{DEFAULT}' for imports"
        )
    if method not in METHODS:
        raise UnknownName(f"method {method!r} must be one of: {'; '.join(METHODS)}; {RIVALS}")
    for option, effective in EFFECTIVE.get(method, Effective())._asdict().items():
        asked = getattr(options, option)
        if asked == getattr(DEFAULTS, option):
            continue
        values = (asked,) if isinstance(asked, str) else asked
        if without := [value for value in values if value not in effective]:
            known = ", ".join(effective) or "none"
            raise Mismatch(
                f"{option} {without[0]!r} has no effect on method {method!r} (with an effect: "
                f"{known}); omit the option"
            )
