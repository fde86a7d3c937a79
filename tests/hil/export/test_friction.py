"""Friction for simulators: simplifications, and their stated deviation from the law."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from scipy import integrate
from stated_model import stated_model

from hil.errors import FrictionUnknown, NotEnoughData
from hil.export.data_files import write_friction
from hil.export.formats import FORMATS
from hil.export.functions import functions
from hil.export.simple_friction import (
    damping_remarks,
    friction_of_joints,
    friction_remarks,
    simple_friction,
)
from hil.export.source_code import description
from hil.friction.law import AxisLaw, FrictionLaw, TermValue
from hil.model.robot import Robot

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from hil.results.model import Model


def set_terms(presliding: float = 0.0, **terms: float) -> Model:
    """Return a model whose axes all have one law with these coefficients, at speeds up to 2."""
    law = AxisLaw(
        law="stated",
        speed=2.0,
        terms={
            k.replace("_", " "): TermValue(value=v, standard_error=0.1) for k, v in terms.items()
        },
        plain={"viscous": TermValue(value=0.0, standard_error=0.1)},
        held_out={},
        wander=0.05,
        speeds=(0.1, 2.0),
        presliding=presliding,
    )
    model = stated_model(Robot.load("manutec-r15"))
    return replace(model, friction_law=FrictionLaw(axes=(law,) * 6))


def test_a_law_of_coulomb_and_viscous_friction_is_itself() -> None:
    first = simple_friction(set_terms(Coulomb=5.0, viscous=3.0))[0]
    assert (first.coulomb, first.viscous) == pytest.approx((5.0, 1.5))  # per rad/s
    assert first.misfit < 1e-12
    assert first.stribeck.misfit < 1e-12


def test_coulomb_friction_of_an_axis_with_presliding_is_not_dropped() -> None:
    first = simple_friction(set_terms(presliding=2e-3, Coulomb=5.0, viscous=3.0))[0]
    assert (first.coulomb, first.viscous) == pytest.approx((5.0, 1.5))
    assert first.misfit < 1e-12
    assert first.size == pytest.approx(6.7, abs=0.1)


def test_what_differs_by_direction_is_left_out_and_counts_as_misfit() -> None:
    first = simple_friction(set_terms(Coulomb=5.0, viscous=3.0, offset=0.7))[0]
    assert (first.coulomb, first.viscous) == pytest.approx((5.0, 1.5))
    assert first.misfit == pytest.approx(0.7)


def test_a_constant_torque_is_named_where_a_format_has_no_place_for_it() -> None:
    left_out = friction_remarks(set_terms(Coulomb=5.0, viscous=3.0, offset=0.7))
    assert (
        "axis 1: the constant torque of 0.700 N m of the friction law (offset) is left out: add it"
        " to the commanded torque"
    ) in left_out
    assert "constant torque" not in str(friction_remarks(set_terms(Coulomb=5.0, viscous=3.0)))


def test_a_degressive_law_is_missed_by_what_is_stated() -> None:
    model = set_terms(Coulomb=5.0, viscous=1.0, arc_tangent=4.0)
    for each in simple_friction(model):
        left = each.forward - each.coulomb - each.viscous * each.speeds
        assert each.misfit == pytest.approx(np.sqrt(np.mean(left**2)))
        assert 0.01 < each.misfit < 0.2 * each.size
        assert each.stribeck.misfit <= each.misfit * (1 + 1e-9)


def test_damping_is_a_number_where_that_coasts_like_the_law() -> None:
    first = simple_friction(set_terms(Coulomb=5.0, viscous=3.0, offset=0.7))[0]
    assert first.damping == (first.viscous,) == pytest.approx((1.5,))
    assert first.coasting == (first.coulomb, first.viscous, 0.0, first.offset, first.misfit)


def test_viscous_friction_of_unknown_range_holds_to_rest() -> None:
    """Held constant below 5 % of the speed, mostly viscous friction got another damping."""
    model = set_terms(Coulomb=0.2, viscous=6.0)
    unknown = tuple(law.model_copy(update={"speeds": None}) for law in model.friction_law.axes)
    first = simple_friction(replace(model, friction_law=FrictionLaw(axes=unknown)))[0]
    assert first.damping == (first.viscous,) == pytest.approx((3.0,))
    assert first.coasting == (first.coulomb, first.viscous, 0.0, first.offset, first.misfit)


def test_quadratic_damping_comes_to_rest_where_the_law_does() -> None:
    for each in simple_friction(set_terms(Coulomb=5.0, viscous=3.0, arc_tangent=-2.0)):
        c, b, d, _, misfit = each.coasting
        assert each.damping == (b, d, 0.0)
        law = (each.forward - each.backward) / 2
        ways = [
            integrate.cumulative_trapezoid(each.speeds / friction, each.speeds)[9::10]
            for friction in (
                law, c + b * each.speeds + d * each.speeds**2,
                each.coulomb + each.viscous * each.speeds,
            )
        ]  # fmt: skip
        quadratic, plain = (np.abs(way / ways[0] - 1).max() for way in ways[1:])
        assert quadratic < 0.02 < plain
        assert misfit < each.misfit


def test_positions_of_coasting_in_both_directions_are_those_of_the_law() -> None:
    terms = {"Coulomb": 5.0, "viscous": 3.0, "arc_tangent": -2.0, "asymmetric": 0.2, "offset": 0.1}
    each = simple_friction(set_terms(**terms))[0]
    c, b, d, constant, _ = each.coasting
    speeds, h = np.concatenate([[0.0], each.speeds]), 1e-4

    def coast(speed: float, friction: Callable[[float], float]) -> NDArray[np.float64]:
        found = [0.0]
        while len(found) < 10000:
            after = max(0.0, speed - h * friction(speed))
            found.append(found[-1] + h * (speed + after) / 2)
            speed = after
        return np.array(found)

    for law, side in ((each.forward, 1.0), (-each.backward, -1.0)):
        own = np.concatenate([law[:1], law])
        for share in (0.25, 0.4, 0.6, 1.0):
            start = share * each.speeds[-1]
            wanted = coast(start, lambda v, own=own: float(np.interp(v, speeds, own)))
            found = coast(start, lambda v, side=side: c + b * v + d * v**2 + side * constant)
            assert np.abs(found - wanted).max() < 0.02 * wanted[-1]


def test_damping_without_a_quadratic_part_is_one_number_that_every_mujoco_reads() -> None:
    model = set_terms(Coulomb=5.0, viscous=1.0, arc_tangent=4.0)
    first = simple_friction(model)[0]
    assert first.coasting.coulomb != first.coulomb
    assert first.damping == (first.coasting.viscous,)
    (said, *_) = damping_remarks(model)
    assert "and damping 2.02 N m s/rad, with which" in said
    assert "MuJoCo 3.7" not in said
    (said, *_) = damping_remarks(set_terms(Coulomb=5.0, viscous=3.0, arc_tangent=-2.0))
    assert "MuJoCo 3.7 or later" in said
    assert not [*damping_remarks(set_terms(Coulomb=5.0, viscous=3.0, offset=0.7))]


def test_damping_never_drives() -> None:
    v = np.linspace(0.0, 100.0, 10001)
    for terms in ({"cube_root": 4.0}, {"arc_tangent": -4.5}, {"quadratic": -1.0}):
        for each in simple_friction(set_terms(Coulomb=5.0, viscous=1.0, **terms)):
            c, b, d, *_ = each.coasting
            assert (c + b * v + d * v**2 >= 0).all()


def test_no_simulator_is_given_a_negative_friction() -> None:
    for each in simple_friction(set_terms(Coulomb=5.0, viscous=-3.0, cube_root=4.0)):
        assert min(each.coulomb, each.viscous, *each.stribeck[:3]) >= 0.0


def test_the_file_holds_the_law_its_curve_and_both_simplifications() -> None:
    model = set_terms(Coulomb=5.0, viscous=1.0, arc_tangent=4.0)
    exported = write_friction(model, ("origin",))
    content = json.loads(exported.files["friction.json"])
    axis = content["axes"][1]
    assert axis["terms"]["Coulomb"]["value"] == 5.0
    v = np.array(axis["curve"]["velocity"])
    qd = np.zeros((len(v), 6))
    qd[:, 1] = v
    wanted = model.predict(0.0, qd, 0.0, parts=["friction"])[:, 1]
    assert axis["curve"]["forward"] == pytest.approx(wanted)
    # three terms with an error of 0.1 each, and a level with a scatter of 5 %
    assert (np.array(axis["curve"]["standard_error"]) >= 0.05 * wanted).all()
    assert axis["coulomb_and_viscous"]["misfit_rms"] > axis["stribeck"]["misfit_rms"]
    assert "axis 2: Coulomb" in exported.remarks[1]
    assert "differ from the law by" in exported.remarks[1]


def test_friction_cold_and_warm_is_stated_with_its_own_misfit() -> None:
    model = stated_model(Robot.load("manutec-r15"), friction=("Coulomb", "arc tangent"), warm=True)
    exported = write_friction(model, ())
    *axes, last = json.loads(exported.files["friction.json"])["axes"]
    assert last["warmth"] is None
    for axis in axes:
        warmth, mean = axis["warmth"], axis["coulomb_and_viscous"]
        for end in (warmth["cold"], warmth["warm"]):
            simple = end["coulomb_and_viscous"]
            for key in ("coulomb", "viscous", "misfit_rms"):
                assert simple[key] == pytest.approx(end["factor"] * mean[key])
        assert warmth["cold"]["factor"] > 1 > warmth["warm"]["factor"]
    assert sum(", cold: Coulomb" in each for each in exported.remarks) == 5
    assert sum(", warm: Coulomb" in each for each in exported.remarks) == 5


def test_a_model_without_friction_is_refused_with_the_remedy() -> None:
    with pytest.raises(NotEnoughData, match=r"no law of friction: .* hil identify"):
        write_friction(stated_model(Robot.load("manutec-r15"), friction=()), ())


def test_an_axis_without_a_law_is_named_and_the_others_are_exported() -> None:
    model = set_terms(Coulomb=5.0, viscous=3.0)
    law = model.friction_law
    assert law is not None
    blind = replace(model, friction_law=FrictionLaw(axes=(*law.axes[:5], None)))
    assert [each.axis for each in simple_friction(blind)] == [0, 1, 2, 3, 4]
    written = write_friction(blind, ())
    content = json.loads(written.files["friction.json"])
    assert [each["axis"] for each in content["axes"]] == [1, 2, 3, 4, 5]
    assert content["unknown"] == [6]
    assert written.remarks[0].startswith("FRICTION UNKNOWN: no law of friction of axis 6")
    assert [each is None for each in friction_of_joints(blind)] == [False] * 5 + [True]


def test_code_keeps_the_laws_of_the_other_axes_and_states_the_one_that_lacks() -> None:
    model = set_terms(Coulomb=5.0, viscous=3.0)
    law = model.friction_law
    assert law is not None
    blind = replace(model, friction_law=FrictionLaw(axes=(*law.axes[:5], None)))
    made = {each.name: each for each in functions(blind)}
    assert made["torque"].purpose.endswith("(unknown and left out for axis 6).")
    assert "FRICTION UNKNOWN: no law of friction of axis 6" in str(
        description(blind, (), functions(blind))
    )
    files = FORMATS["python"](blind, ()).files
    scope: dict[str, Any] = {}
    exec(next(iter(files.values())), scope)  # noqa: S102 - our own code
    q, qd, qdd = [0.1] * 6, [0.4] * 6, [0.2] * 6
    with pytest.warns(FrictionUnknown):
        wanted = blind.predict(q, qd, qdd)
    assert scope["torque"](q, qd, qdd) == pytest.approx(wanted)
