"""`hil export --patch`: a copy of the user's file with only the values changed."""

import csv
import io
import re
from dataclasses import replace

import numpy as np
import pytest
from mjcf_robots import ARM, ONE_JOINT, write_arm
from possible_models import model_of
from urdf_robots import ROBOTS, TREES, urdf

import hil
from hil.errors import InvalidValue, Mismatch, NotRealisable
from hil.estimation.free_motion.result import FreeMotionFit
from hil.export import patch
from hil.export.exported import write_exported
from hil.export.patch import patched_file
from hil.friction.law import FrictionLaw, TermValue
from hil.model.base_parameters import base_parameters
from hil.model.dynamics import inverse_dynamics
from hil.tasks.exporting import exported_model

mujoco = pytest.importorskip("mujoco")
VALUE = re.compile(
    r"\s*\b(value|xyz|mass|pos|quat|euler|diaginertia|fullinertia|armature|damping|frictionloss"
    r"|friction|i[xyz]{2})\s*=\s*(\"[^\"]*\"|'[^']*')"
)


def identified(path, **changes):
    """Return a model of a file's robot, with bodies and rotors changed as if by identification."""
    robot = hil.Robot.load(path)
    file = patched_file(path, robot)
    added = dict(zip(robot.added_parameters, file.rotors(), strict=False))
    stated = np.concatenate([file.bodies().ravel(), [added[n] for n in robot.added_parameters]])
    for name, factor in changes.items():
        stated[robot.standard_parameters.index(name)] *= factor
    p = base_parameters(robot).matrix @ stated
    return model_of(robot, p, 1e-6 * np.ones(len(p)))


def torques(path, q, qd, qdd):
    model = mujoco.MjModel.from_xml_path(str(path))
    model.dof_damping[:], model.dof_frictionloss[:] = 0.0, 0.0
    data = mujoco.MjData(model)
    found = []
    for data.qpos[:], data.qvel[:], data.qacc[:] in zip(q, qd, qdd, strict=True):
        mujoco.mj_inverse(model, data)
        found.append(data.qfrc_inverse.copy())
    return np.array(found)


def test_mujoco_has_the_model_s_torques_after_the_patch_and_nothing_else_of_the_file_changed(
    tmp_path,
):
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    model = identified(path, Izz3=1.2, sx2=1.3, Izz2=1.15, Ia2=1.5)
    _, exported = exported_model(model, "mjcf", path, patch=path)
    written = write_exported(exported, tmp_path / "new")
    assert [str(each.relative_to(tmp_path / "new")) for each in written] == [
        "arm.xml", "parts/wrist.xml", "arm.values.csv",
    ]  # fmt: skip
    rng = np.random.default_rng(4)
    motion = [rng.uniform(-1.0, 1.0, (6, 3)) for _ in range(3)]
    expected = inverse_dynamics(model.robot, model.values, *motion)
    before, after = torques(path, *motion), torques(written[0], *motion)
    assert np.abs(before - expected).max() > 0.1
    np.testing.assert_allclose(after, expected, atol=2e-4 * np.abs(expected).max())
    for name, old in (("arm.xml", ARM), ("parts/wrist.xml", ONE_JOINT)):
        assert VALUE.sub("", exported.files[name]) == VALUE.sub("", old)
    loaded = mujoco.MjModel.from_xml_path(str(written[0]))
    old = mujoco.MjModel.from_xml_path(str(path))
    np.testing.assert_allclose(loaded.dof_frictionloss, 3.0)
    np.testing.assert_allclose(np.ravel(loaded.dof_damping)[:3], 0.5)
    for same in ("jnt_range", "body_pos", "body_quat", "jnt_pos", "qpos0", "actuator_gear"):
        np.testing.assert_array_equal(getattr(loaded, same), getattr(old, same))


def test_what_no_torque_depends_on_keeps_its_text_and_is_named(tmp_path):
    arm = ARM.replace('gravity="0 0.5 -9.7"', 'gravity="0 0 -9.81"')
    path = write_arm(tmp_path / "arm", arm, ONE_JOINT)
    model = identified(path, Izz1=1.5)
    _, exported = exported_model(model, "mjcf", path, patch=path)
    (remark,) = [each for each in exported.remarks if each.startswith("upper, pan")]
    assert "mass of upper, pos of upper" in remark
    assert "armature" in remark  # the link's own inertia about the axis absorbs the difference
    text = exported.files["arm.xml"]
    assert 'pos="0.02 0.01 0.1" mass="4"' in text
    assert "<!-- keep   me -->" in text


def test_a_urdf_keeps_everything_but_numbers_of_inertials_and_dynamics(tmp_path):
    text = "<!-- mine -->\n" + urdf("askew arm", ROBOTS["askew"], rigid_link=True)
    text = text.replace('<mass value="3"/>', "<mass   value = '3' /> <!-- heavy -->")
    path = tmp_path / "arm.urdf"
    path.write_text(text)
    model = identified(path, m4=1.25)
    _, exported = exported_model(model, "urdf", path, patch=path)
    new = exported.files["arm.urdf"]
    added = re.compile(r"\n\s*<dynamics damping=\"[^\"]*\" friction=\"[^\"]*\"/>")
    assert len(added.findall(new)) == 4
    assert VALUE.sub("", added.sub("", new)) == VALUE.sub("", text)
    (tmp_path / "new.urdf").write_text(new)
    again = identified(tmp_path / "new.urdf")
    size = np.abs(model.values).max()
    np.testing.assert_allclose(again.values, model.values, atol=1e-4 * size)


def test_a_tree_keeps_everything_but_numbers(tmp_path):
    joints, parents = TREES["two arms"]
    (path := tmp_path / "arms.urdf").write_text(urdf("arms", joints, parents))
    model = identified(path, m4=1.25, Izz6=1.2)
    new = exported_model(model, "urdf", path, patch=path)[1].files["arms.urdf"]
    (tmp_path / "new.urdf").write_text(new)
    again = identified(tmp_path / "new.urdf")
    assert not again.robot.is_chain
    np.testing.assert_allclose(again.values, model.values, atol=1e-4 * np.abs(model.values).max())
    (mjcf,) = exported_model(model, "mjcf", path)[1].files.values()
    (path := tmp_path / "arms.xml").write_text(mjcf)
    model = identified(path, m4=1.25, Izz6=1.2)
    assert model.robot.parents == (-1, 0, 1, 2, 0, 4, 5)
    _, exported = exported_model(model, "mjcf", path, patch=path)
    written = write_exported(exported, tmp_path / "new")
    motion = [np.random.default_rng(4).uniform(-1.0, 1.0, (6, 7)) for _ in range(3)]
    expected = inverse_dynamics(model.robot, model.values, *motion)
    before, after = torques(path, *motion), torques(written[0], *motion)
    assert np.abs(before - expected).max() > 0.01
    np.testing.assert_allclose(after, expected, atol=2e-4 * np.abs(expected).max())


def lacking_data(model, *columns, rests=()):
    """Return a model whose recordings say nothing of some base parameters: 0, and any error."""
    values, covariance = model.values.copy(), model.scatter_covariance.copy()
    values[list(columns)] = 0.0
    covariance[columns, columns] = 100.0
    details = FreeMotionFit.model_construct(rest=dict.fromkeys(rests, 0.0), not_identified=())
    return replace(model, values=values, scatter_covariance=covariance, details=details)


@pytest.mark.parametrize("to", ["urdf", "mjcf"])
def test_what_the_recordings_leave_open_stays_near_the_file(tmp_path, to):
    """A missing inertia of the first axis counted as zero, and took the links' inertia with it."""
    if to == "mjcf":
        path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    else:
        (path := tmp_path / "arm.urdf").write_text(urdf("askew arm", ROBOTS["askew"]))
    whole = identified(path)
    model = lacking_data(whole, 0, 1, rests=(1,))
    patched, exported = exported_model(model, to, path, patch=path)
    np.testing.assert_allclose(patched.consistent.values, whole.values, rtol=0.3, atol=1e-3)
    assert any("friction of axis 1 is unknown" in each for each in exported.remarks)
    rows = list(csv.DictReader(io.StringIO(exported.files["arm.values.csv"])))
    assert any(int(row["shown by recordings, %"]) < 50 for row in rows)
    assert {row["quantity"] for row in rows} >= (
        {"friction", "damping"} if to == "urdf" else {"frictionloss", "damping", "armature"}
    )
    assert any("not shown by these recordings" in each for each in exported.remarks)


def test_sums_that_strokes_show_hold_and_their_parts_stay_near_the_file(tmp_path):
    """With 0 in place of one part, no body had the sum."""
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    whole = identified(path, Izz2=1.2)
    C, V = np.eye(len(whole.values)), whole.scatter_covariance.copy()
    C[0, 1], C[1, 1], V[1, 1] = 0.8, 0.0, 0.0
    model = replace(whole, values=C @ whole.values, scatter_covariance=V, combination=C)
    patched, _ = exported_model(model, "mjcf", path, patch=path)
    found, truth = np.array(patched.consistent.values), whole.values
    np.testing.assert_allclose((C @ found)[0], (C @ truth)[0], rtol=1e-3)
    np.testing.assert_allclose(found, truth, rtol=0.3, atol=1e-3)
    model.save(tmp_path / "model.yaml")
    np.testing.assert_array_equal(hil.Model.load(tmp_path / "model.yaml").combination, C)


def test_damping_of_several_numbers_has_no_interval(tmp_path):
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    model = identified(path)
    terms = {"Coulomb": 5.0, "viscous": 3.0, "arc tangent": -2.0}
    law = model.friction_law.axes[0].model_copy(
        update={"law": "stated", "terms": TermValue.named(terms, list(terms.values()), np.eye(3))}
    )
    model = replace(model, friction_law=FrictionLaw(axes=(law,) * 3))
    exported = exported_model(model, "mjcf", path, patch=path)[1]
    rows = csv.DictReader(io.StringIO(exported.files["arm.values.csv"]))
    damping = [row for row in rows if row["quantity"] == "damping"]
    assert [row["low 95 %"] for row in damping] == ["", "", ""]
    assert all(np.isfinite(float(row["model"])) for row in damping)


def test_each_value_stands_beside_that_of_the_file_with_its_interval(tmp_path):
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    truth = {"Izz3": 1.2, "sx2": 1.3, "Izz2": 1.15, "Ia2": 1.5}
    model = identified(path, **truth)
    exported = exported_model(model, "mjcf", path, patch=path)[1]
    rows = list(csv.DictReader(io.StringIO(exported.files["arm.values.csv"])))
    assert {row["unit"] for row in rows} == {"kg", "m", "kg m^2", "N m", "N m s/rad"}
    found = {(row["of"], row["quantity"]): row for row in rows}
    first = found["upper", "mass"]  # on a vertical axis but for 3 degrees
    assert float(first["model"]) == pytest.approx(4.0, rel=0.1)
    assert int(first["shown by recordings, %"]) < 50
    assert float(first["high 95 %"]) > 8.0
    assert any("no motion on this base shows them alone" in each for each in exported.remarks)
    rotor = found["lift", "armature"]
    assert rotor["shown by recordings, %"] == rotor["by any motion, %"]
    for row in rows:
        low, value, high = (float(row[key]) for key in ("low 95 %", "model", "high 95 %"))
        assert low <= value <= high


FINGER = """<body name="finger" pos="0 0.1 0.1"><joint name="grip" class="main" axis="0 1 0"/>
      <inertial pos="0.1 0 0.05" mass="0.4" diaginertia="0.002 0.001 0.001"/></body>"""
"""Moving link beyond the chain."""


def test_links_beyond_the_chain_are_not_counted_twice(tmp_path):
    arm = ARM.replace('gravity="0 0.5 -9.7"', 'gravity="0 0 -9.81"')
    wrist = ONE_JOINT.replace('<body name="tool"', FINGER + '<body name="tool"')
    path = write_arm(tmp_path / "arm", arm, wrist)
    robot = hil.Robot.load(path, tip="hand")
    motion = [np.random.default_rng(4).uniform(-1.0, 1.0, (40, 3)) for _ in range(3)]
    at_zero = [np.column_stack([each, np.zeros(40)]) for each in motion]
    measured = torques(path, *at_zero)[:, :3]
    p = np.linalg.lstsq(hil.regressor(robot, *motion).reshape(120, -1), measured.ravel())[0]
    model = model_of(robot, p, 1e-6 * np.ones(len(p)))
    _, exported = exported_model(model, "mjcf", path, patch=path)
    assert any("joints grip: not of the model" in each for each in exported.remarks)
    new = write_exported(exported, tmp_path / "new")[0]
    np.testing.assert_allclose(
        torques(new, *at_zero)[:, :3], measured, atol=1e-4 * np.abs(measured).max()
    )


def test_links_beyond_the_chain_of_a_urdf_are_not_counted_twice(tmp_path):
    (path := tmp_path / "arm.urdf").write_text(urdf("askew arm", ROBOTS["askew"]))
    joints = len(ROBOTS["askew"])
    robot = hil.Robot.load(path, tip=f"link{joints - 1}")
    whole = identified(path)
    rng = np.random.default_rng(4)
    motion = [rng.uniform(-1.0, 1.0, (60, joints - 1)) for _ in range(3)]
    at_zero = [np.column_stack([each, np.zeros(60)]) for each in motion]
    measured = inverse_dynamics(whole.robot, whole.values, *at_zero)[:, :-1]
    A = hil.regressor(robot, *motion).reshape(measured.size, -1)
    model = model_of(robot, np.linalg.lstsq(A, measured.ravel())[0], 1e-6 * np.ones(A.shape[1]))
    _, exported = exported_model(model, "urdf", path, patch=path)
    assert any(f"joints joint{joints}: not of the model" in each for each in exported.remarks)
    (tmp_path / "new.urdf").write_text(exported.files["arm.urdf"])
    again = identified(tmp_path / "new.urdf")
    found = inverse_dynamics(again.robot, again.values, *at_zero)[:, :-1]
    np.testing.assert_allclose(found, measured, atol=1e-3 * np.abs(measured).max())


def test_rotors_of_the_file_stay_where_open_ones_have_no_solution(tmp_path, monkeypatch):
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    model = identified(path, Izz3=0.01)  # no body beside the rotors of the file
    solved, calls = patch.nearest_robot, []

    def lost(*args):
        calls.append(args)
        if len(calls) > 1:
            raise NotRealisable("none")
        return solved(*args)

    monkeypatch.setattr(patch, "nearest_robot", lost)
    assert exported_model(model, "mjcf", path, patch=path)[1].files
    assert len(calls) == 2


def test_files_that_cannot_be_patched_are_refused_with_what_to_do(tmp_path):
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    model = identified(path)
    with pytest.raises(InvalidValue, match="an MJCF with --to mjcf"):
        exported_model(model, "urdf", path, patch=path)
    other = write_arm(
        tmp_path / "b", ARM.replace('pos="0.1 0.05 0"', 'pos="0.1 0.06 0"'), ONE_JOINT
    )
    with pytest.raises(Mismatch, match="no chain of 3 joints has the frames"):
        exported_model(model, "mjcf", path, patch=other)
    double = write_arm(tmp_path / "c")
    with pytest.raises(Mismatch, match="a body with two joints: give each joint a body"):
        patched_file(double, hil.Robot.load(double))


def test_where_welded_bodies_leave_no_body_for_their_link_all_of_them_change_alike(tmp_path):
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    model = identified(path)
    heavy = write_arm(tmp_path / "b", wrist=ONE_JOINT.replace('mass="0.2"', 'mass="2"'))
    _, exported = exported_model(model, "mjcf", heavy, patch=heavy)
    new = write_exported(exported, tmp_path / "new")[0]
    motion = [np.random.default_rng(4).uniform(-1.0, 1.0, (6, 3)) for _ in range(3)]
    expected = inverse_dynamics(model.robot, model.values, *motion)
    np.testing.assert_allclose(torques(new, *motion), expected, atol=1e-3 * np.abs(expected).max())
    assert 'mass="2"' not in exported.files["parts/wrist.xml"]


def test_a_rotor_that_leaves_its_link_no_inertia_takes_the_difference_itself(tmp_path):
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    model = identified(path)
    large = write_arm(tmp_path / "b", ARM.replace('armature="0.8"', 'armature="1.2"'), ONE_JOINT)
    _, exported = exported_model(model, "mjcf", large, patch=large)
    new = write_exported(exported, tmp_path / "new")[0]
    motion = [np.random.default_rng(4).uniform(-1.0, 1.0, (6, 3)) for _ in range(3)]
    expected = inverse_dynamics(model.robot, model.values, *motion)
    np.testing.assert_allclose(torques(new, *motion), expected, atol=1e-3 * np.abs(expected).max())


@pytest.mark.parametrize("armature", ["0.84", "0.86", "0.9"])
def test_a_rotor_that_leaves_its_link_no_possible_body_gives_way(tmp_path, armature):
    path = write_arm(tmp_path / "arm", wrist=ONE_JOINT)
    model = identified(path)
    text = ARM.replace('armature="0.8"', f'armature="{armature}"')
    larger = write_arm(tmp_path / "b", text, ONE_JOINT)
    _, exported = exported_model(model, "mjcf", larger, patch=larger)
    new = write_exported(exported, tmp_path / "new")[0]
    motion = [np.random.default_rng(4).uniform(-1.0, 1.0, (6, 3)) for _ in range(3)]
    expected = inverse_dynamics(model.robot, model.values, *motion)
    np.testing.assert_allclose(torques(new, *motion), expected, atol=1e-3 * np.abs(expected).max())
