#!/usr/bin/env bash
# Ruckig 0.19.4: a limit set by index is lost without an error.
#
# Input: two axes, max_velocity [1, 1] rad/s, then the limit of axis 1 lowered
# to 0.1 rad/s in place: parameters.max_velocity[0] = 0.1.
#
# Expected: the limit holds. `max_velocity` is a list that can be read, printed
# and assigned; assigning to its items raises nothing. In C++ the member of the
# same name is written by index.
#
# Seen: each access returns a new list, so the assignment is lost. The
# trajectory reaches 1.0 rad/s, ten times the intended limit, validation passes
# and the result is "Working". The same holds for positions: writing the
# measured position of one axis into current_position[0] each cycle plans from
# the old one.
#
# Documentation: the examples assign whole lists. That items cannot be assigned
# is not stated.
#
# Exit 0: as described. Exit 1: the behaviour has changed.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check ruckig==0.19.4
venv/bin/python - <<'EOF'
import sys

from ruckig import InputParameter, Result, Ruckig, Trajectory

INTENDED = 0.1


def top_speed(parameters):
    """Return the largest speed of axis 1 on its way to the target [rad/s]."""
    planner, trajectory = Ruckig(2), Trajectory(2)
    valid = planner.validate_input(parameters)
    result = planner.calculate(parameters, trajectory)
    times = [trajectory.duration * k / 2000 for k in range(2001)]
    return valid, result, max(abs(trajectory.at_time(t)[1][0]) for t in times)


parameters = InputParameter(2)
parameters.current_position = [0.0, 0.0]
parameters.target_position = [1.0, 0.5]
parameters.max_velocity = [1.0, 1.0]
parameters.max_acceleration = [2.0, 2.0]
parameters.max_jerk = [10.0, 10.0]

parameters.max_velocity[0] = INTENDED
kept = list(parameters.max_velocity)
valid, result, speed = top_speed(parameters)
print(f"max_velocity after max_velocity[0] = {INTENDED}: {kept}")
print(f"valid: {valid}, result: {result}, top speed of axis 1: {speed:.2f} rad/s")

parameters.current_position[0] = 0.3
position = list(parameters.current_position)
print(f"current_position after current_position[0] = 0.3: {position}")

parameters.max_velocity = [INTENDED, 1.0]
_, _, limited = top_speed(parameters)
print(f"top speed after assigning the whole list: {limited:.2f} rad/s")

as_described = (
    kept == [1.0, 1.0]
    and position == [0.0, 0.0]
    and valid
    and result == Result.Working
    and speed > 5 * INTENDED
    and limited <= INTENDED + 1e-9
)
print("as described" if as_described else "CHANGED")
sys.exit(0 if as_described else 1)
EOF
