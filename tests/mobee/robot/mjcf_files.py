# SPDX-License-Identifier: Apache-2.0
"""MJCF files for tests."""

from __future__ import annotations

from pathlib import Path


def mjcf_file(folder: Path, text: str, name: str = "toy.xml") -> Path:
    """A file with this text inside <mujoco>."""
    path = folder / name
    path.write_text(f'<mujoco model="toy">\n{text}\n</mujoco>\n', encoding="utf-8")
    return path


TREE = """
<compiler angle="degree" eulerseq="xyz"/>
<default>
 <joint axis="0 1 0" range="-80 120"/>
 <default class="slim"><geom type="capsule" size=".02 .1"/></default>
</default>
<worldbody>
 <geom name="floor" type="plane" size="1 1 .1"/>
 <geom name="post" type="box" size=".1 .1 .3" pos=".5 0 .3"/>
 <body name="torso" pos="0 .1 1" euler="10 20 30">
  <freejoint name="root"/>
  <geom name="chest" type="ellipsoid" size=".1 .15 .2"/>
  <body name="shoulder" pos="0 .2 .1" euler="0 40 0">
   <joint name="roll" axis="1 0 0" pos="0 .01 0"/>
   <joint name="yaw" axis="0 0 2" ref="15"/>
   <joint name="out" type="slide" axis="0 1 1" range="0 .2" ref=".05"/>
   <geom name="upper" class="slim" pos="0 0 -.1"/>
   <body name="bracket" pos="0 0 -.25" euler="5 0 0">
    <site name="camera" pos=".02 0 0" euler="0 90 0"/>
    <geom name="plate" type="box" size=".02 .03 .01"/>
    <body name="forearm" pos="0 0 -.05">
     <joint name="elbow" ref="-20"/>
     <geom name="lower" class="slim" pos="0 0 -.1"/>
     <body name="finger_1" pos=".02 0 -.22"><joint name="f1" type="slide" axis="1 0 0" range="0 .04"/><geom size=".01"/></body>
     <body name="finger_2" pos="-.02 0 -.22"><joint name="f2" type="slide" axis="-1 0 0" range="0 .03"/><geom name="pad" size=".01"/></body>
    </body>
   </body>
  </body>
  <body name="leg" pos="0 -.2 -.2">
   <joint name="hip" range="-170 170"/>
   <geom class="slim" pos="0 0 -.1"/>
   <body name="shin" pos="0 0 -.25"><joint name="knee"/><geom class="slim" pos="0 0 -.1" contype="0" conaffinity="0"/></body>
  </body>
 </body>
</worldbody>
"""
"""A torso that moves freely, with an arm whose shoulder is three joints of one body, a gripper, and a leg; every frame is turned."""
