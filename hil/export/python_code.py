"""A model as one Python module that needs numpy alone; its functions take any number of samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hil.export.exported import Exported
from hil.export.functions import functions
from hil.export.source_code import Syntax, assignments, description, identifier, remarks

if TYPE_CHECKING:
    from hil.export.functions import Function
    from hil.results.model import Model

_FUNCTIONS = {"atan": "arctan"}
SYNTAX = Syntax(
    number=lambda value: repr(value) if value >= 0 else f"({value!r})",
    function=lambda name, of: (
        f"_direction({of})" if name == "direction" else f"np.{_FUNCTIONS.get(name, name)}({of})"
    ),
)
_HELPERS = '''
def _columns(joint_array):
    """Values of each joint, from an array of shape (n_joints,) or (n_samples, n_joints)."""
    values = np.asarray(joint_array, dtype=float)
    if values.shape[-1:] != (JOINTS,):
        raise ValueError(f"shape {values.shape}: the last axis must be {JOINTS} joints")
    return np.moveaxis(values, -1, 0)


def _direction(share):
    """Sign of a velocity; 0 where it is too slow to have one."""
    return np.trunc(np.clip(share, -1.0, 1.0))


def _stacked(samples, results):
    """Results of each joint as one array, joints last."""
    return np.stack([np.broadcast_to(each, samples.shape) for each in results], axis=-1)
'''


def write_python(model: Model, origin: tuple[str, ...]) -> Exported:
    """Return the model as a module."""
    name, found = identifier(model.robot.name), functions(model)
    head = "\n".join(f"# {line}".rstrip() for line in description(model, origin, found))
    text = "\n".join([
        head,
        '"""Dynamics of an identified robot; see above for origin and units."""\n',
        "import numpy as np\n",
        f"JOINTS = {model.robot.n_joints}",
        f"MOTOR_INERTIA = np.array({model.robot.reflected_inertia.tolist()!r})",
        _HELPERS,
        *(_function(each) for each in found),
    ])  # fmt: skip
    return Exported({f"{name}_dynamics.py": text}, remarks(model, found))


def _function(function: Function) -> str:
    named, values = assignments(function.results, SYNTAX)
    first = next(iter(function.arguments))
    lines = [
        f'"""{function.purpose}"""',
        *(f"{each} = _columns({each})" for each in function.arguments),
        *(f"{each.name} = {each.value}" for each in named),
        "results = [",
        *(f"    {value}," for value in values),
        "]",
        f"found = _stacked({first}[0], results)",
        _returned(function),
    ]
    body = "\n".join(f"    {line}" for line in lines)
    return f"\ndef {function.name}({', '.join(function.arguments)}):\n{body}\n"


def _returned(function: Function) -> str:
    if function.name == "mass_matrix":
        return "return found.reshape(*found.shape[:-1], JOINTS, JOINTS)"
    return "return found"
