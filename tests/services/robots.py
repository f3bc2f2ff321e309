# SPDX-License-Identifier: Apache-2.0
"""Small robots of a user's own, as text of their files."""

from __future__ import annotations

ARM = """\
<ZeroPositionKinematicTree version="2.0" robotName="arm">
 <bodypart name="arm">
  <motor name="pan" minPos="-90" maxPos="90" home="0">
   <joint z="1">
    <link x="-0.2" radius="0.02">
     <motor name="bend" minPos="-90" maxPos="90" home="30">
      <joint y="-1"><marker name="tip" px="-0.2" nx="-1"/><link x="-0.2" radius="0.02"/></joint>
     </motor>
    </link>
   </joint>
  </motor>
 </bodypart>
</ZeroPositionKinematicTree>
"""

_EYES = """<marker name="left_eye" py="-0.03" nx="-1"/><marker name="right_eye" py="0.03" nx="-1"/>"""


def seer(block: str = "", eyes: str = _EYES, head: str = "head") -> str:
    """A robot with two eyes on a neck; `block`: a volume on its torso."""
    return f"""\
<ZeroPositionKinematicTree version="2.0" robotName="seer">
 <bodypart name="torso">
  <motor name="turn" minPos="-90" maxPos="90" home="0">
   <joint z="1">
    {block}
    <link z="0.3">
     <bodypart name="{head}">
      <motor name="nod" minPos="-40" maxPos="40" home="0"><joint y="-1">{eyes}</joint></motor>
     </bodypart>
    </link>
   </joint>
  </motor>
 </bodypart>
</ZeroPositionKinematicTree>
"""


def chain(motors: int) -> str:
    """The URDF of an arm of so many revolute joints; its one part is `all`, its one marker the last link."""
    pieces = ["<robot name='chain'><link name='base'/>"]
    for k in range(motors):
        parent = f"link_{k - 1}" if k else "base"
        axis = "0 0 1" if k % 2 == 0 else "0 1 0"
        solid = "<collision><origin xyz='0 0 0.1'/><geometry><cylinder radius='0.02' length='0.1'/></geometry></collision>"
        pieces.append(
            f"<link name='link_{k}'>{solid}</link><joint name='joint_{k}' type='revolute'><parent link='{parent}'/><child link='link_{k}'/>"
            f"<origin xyz='0 0 {0.2 if k else 0}'/><axis xyz='{axis}'/><limit lower='-2' upper='2' velocity='2' effort='10'/></joint>"
        )
    return "".join(pieces) + "</robot>"
