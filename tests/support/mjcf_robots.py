"""MJCF arms with defaults, classes, includes, degrees, offset joints, two joints in a body."""

import re

ARM = """<!-- an arm,   oddly formatted -->
<mujoco model="test arm">
  <compiler angle="degree" autolimits="true"/>
  <option gravity="0 0.5 -9.7"/>
  <default>
    <joint damping="0.3"/>
    <default class="big"><joint armature="0.8"
        damping = '1.5' frictionloss="2"/></default>
  </default>
  <worldbody>
    <light pos="0 0 3"/>
    <body name="stand" pos="0.1 0 0.2" euler="0 0 30">
      <geom type="box" size=".1 .1 .1" mass="9"/>
      <body name="upper" pos="0 0 0.1" childclass="big">
        <inertial pos="0.02 0.01 0.1" mass="4" diaginertia="0.08 0.07 0.03" euler="10 0 20"/>
        <joint name="pan" axis="0 0 1" range="-170 170"/>  <!-- keep   me -->
        <frame euler="0 90 0">
          <body name="fore" pos="0.1 0.05 0">
            <inertial pos="0.15 0 0.01" mass="2.5" fullinertia="0.02 0.05 0.06 0.001 0.002 0"/>
            <joint name="lift" axis="0 2 0" pos="-0.02 0 0.03" ref="20" range="-60 100"
                   actuatorfrcrange="-80 80"/>
            <include file="parts/wrist.xml"/>
          </body>
        </frame>
      </body>
    </body>
  </worldbody>
  <actuator><motor joint="pan" gear="50"/></actuator>
</mujoco>
"""
WRIST = """<mujoco>
  <body name="hand" pos="0.3 0 0">
    <inertial pos="0 0 0.05" mass="0.8" diaginertia="0.003 0.004 0.002"/>
    <joint name="roll" class="main" axis="1 0 0" armature="0.01"/>
    <joint name="slide" class="main" type="slide" axis="0 0 1" range="-0.1 0.2" pos="0 0 0.1"/>
    <body name="tool" pos="0 0 0.1">
      <inertial pos="0 0 0" mass="0.2" diaginertia="0.0002 0.0002 0.0002"/>
    </body>
  </body>
</mujoco>
"""
ONE_JOINT = re.sub(r" *<joint name=\"slide\".*\n", "", WRIST)
"""Wrist without its second joint."""

WHOLE = re.sub("<include.*?>", re.sub("</?mujoco>", "", WRIST), ARM)
"""Arm in one file."""


def write_arm(folder, arm=ARM, wrist=WRIST):
    """Write the arm and the included wrist; return the arm's path."""
    (folder / "parts").mkdir(parents=True)
    (folder / "parts" / "wrist.xml").write_text(wrist)
    (folder / "arm.xml").write_text(arm)
    return folder / "arm.xml"
