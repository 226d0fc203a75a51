"""MJCF texts, each with one thing that a reader or a writer may get wrong, and random trees."""

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

INERTIAL = '<inertial pos=".1 .02 .03" mass="2" diaginertia=".1 .2 .25"/>'
TURNED = '<inertial pos=".05 -.02 .1" quat=".9 .1 .3 -.2" mass="1.3" diaginertia=".03 .02 .04"/>'
FULL = '<inertial pos="0 .1 .02" mass=".8" fullinertia=".02 .03 .025 .001 .002 .003"/>'


def model(bodies: str, before: str = "", after: str = "") -> str:
    return (
        f'<mujoco model="case"><!-- kept -->{before}<worldbody><light pos="0 0 3"/>{bodies}</worldbody>{after}</mujoco>'
    )


CASES = {
    "tilted axis and joint offset": model(
        f'<body name="a" pos="0 0 .3" euler="10 20 30"><joint name="j1" axis="1 2 3" pos=".1 -.2 .3"/>{TURNED}'
        f'<body name="b" pos=".3 0 0"><joint name="j2" axis="0 1 0" pos="0 .1 0" damping=".3" frictionloss=".2"/>{FULL}'
        "</body></body>"
    ),
    "reference angles": model(
        f'<body name="a"><joint name="j1" axis="0 1 1" ref="15"/>{INERTIAL}'
        f'<body name="b" pos=".2 0 0"><joint name="s" type="slide" axis="1 1 0" ref=".3"/>{TURNED}</body></body>'
    ),
    "several joints on one body": model(
        '<body name="a" pos="0 0 1"><joint name="x" type="slide" axis="1 0 0" armature=".5"/>'
        '<joint name="y" type="slide" axis="0 1 0"/><joint name="turn" axis="0 0 1" pos=".1 0 0"/>'
        f'{FULL}<body name="b" pos="0 0 .2"><joint name="j" axis="0 1 0"/>{INERTIAL}</body></body>'
    ),
    "fixed tools": model(
        f'<body name="a"><joint name="j1" axis="0 0 1"/>{INERTIAL}<body name="grip" pos="0 0 .1" euler="0 30 0">{FULL}'
        f'<body name="tip" pos="0 0 .05">{TURNED}</body></body>'
        f'<body name="b" pos=".2 0 0"><joint name="j2" axis="1 0 0"/>{FULL}</body></body>'
        f'<body name="table">{INERTIAL}</body>'
    ),
    "frames and defaults": model(
        '<frame euler="20 0 0" pos=".1 0 0"><body name="a" childclass="soft"><joint name="j1"/>'
        + INERTIAL
        + '<frame pos="0 0 1">'
        f'<body name="b" pos="0 0 1" xyaxes="0 1 0 0 0 1"><joint name="j2" class="stiff"/>{TURNED}</body></frame>'
        "</body></frame>",
        before='<default><joint damping=".1" armature=".01"/><default class="soft"><joint damping=".7" axis="0 1 0"/>'
        '<default class="stiff"><joint frictionloss=".4" armature=".02"/></default></default></default>',
    ),
    "nothing has a name": model(
        f'<body><joint axis="0 0 1"/>{INERTIAL}<body pos=".1 0 0"><joint axis="0 1 0"/>{FULL}</body></body>'
    ),
    "replicated fingers": model(
        f'<body name="palm"><joint name="wrist"/>{INERTIAL}<replicate count="3" euler="0 0 120">'
        f'<body name="finger" pos=".123456789012345 0 0"><joint name="bend" axis="0 1 0"/>{TURNED}</body></replicate>'
        "</body>"
    ),
    "inertia from geometry": model(
        '<body name="a"><joint name="j1" axis="0 1 0"/><geom type="capsule" size=".05" fromto="0 0 0 0 0 .3"/>'
        '<geom type="box" size=".05 .1 .02" pos=".1 0 .2" euler="10 20 0"/><body name="b" pos="0 0 .3">'
        '<joint name="j2" axis="1 0 0"/><geom type="sphere" size=".08" pos="0 0 .1"/></body></body>'
    ),
    "geometry overrides inertia": model(
        f'<body name="a"><joint name="j1"/>{INERTIAL}<geom type="box" size=".05 .1 .02" pos=".1 0 .2"/>'
        f'<body name="fixed" pos="0 0 .1">{FULL}<geom size=".05"/></body></body>',
        before='<compiler inertiafromgeom="true" angle="radian"/>',
    ),
    "bounded inertia": model(
        f'<body name="a"><joint name="j1"/>{INERTIAL}<body name="light" pos="0 0 .1">'
        '<joint name="j2" axis="0 1 0"/><inertial pos="0 0 0" mass=".01" diaginertia=".001 .001 .0001"/></body></body>',
        before='<compiler boundmass=".5" boundinertia=".01" balanceinertia="true"/>',
    ),
    "geared motors": model(
        f'<body name="a"><joint name="j1" armature=".1" damping=".2"/>{INERTIAL}'
        f'<body name="b" pos=".1 0 0"><joint name="j2" axis="0 1 0"/>{FULL}</body></body>',
        after='<actuator><motor name="m1" joint="j1" gear="3" armature=".01" damping=".02" ctrlrange="-5 5"/>'
        '<motor name="m2" joint="j2" gear="10" armature=".001" forcerange="-4 4"/></actuator>',
    ),
    "free base, ball and hinge": model(
        f'<body name="base" pos="0 0 1" euler="5 6 7"><freejoint/>{INERTIAL}<body name="ball" pos=".3 0 0">'
        f'<joint name="hip" type="ball" pos="0 .1 0" armature=".05" damping=".3"/>{TURNED}'
        f'<body name="shin" pos=".2 0 0"><joint name="knee" axis="0 1 1" ref="15"/>{FULL}</body></body></body>',
        before='<option gravity="1 2 -9"/>',
    ),
}


@st.composite
def trees(draw) -> str:
    """Random trees: bodies with none, one or two joints of any kind, turned, offset, with reference positions."""
    depth = draw(st.integers(1, 4))
    bodies, closing = "", ""
    for b in range(depth):
        x = draw(hnp.arrays(np.float64, 18, elements=st.floats(-1.0, 1.0, width=32)))
        kinds = ["hinge"] if b == 0 else draw(st.sampled_from([[], ["hinge"], ["ball"], ["slide", "hinge"], ["slide"]]))
        joints = "".join(_joint(f"{kind}{b}", kind, x) for kind in kinds)
        quat = _text([1.5, *x[:3]])
        bodies += f'<body name="b{b}" pos="{_text(x[3:6])}" quat="{quat}">{joints}{INERTIAL}'
        if draw(st.booleans()):
            bodies, closing = bodies + f'<body name="f{b}" pos="{_text(x[6:9])}">{TURNED}</body>', closing
        branches = draw(st.booleans())
        bodies, closing = (bodies + "</body>", closing) if branches else (bodies, closing + "</body>")
    return model(bodies + closing)


def _joint(name: str, kind: str, x: np.ndarray) -> str:
    ref = f'ref="{float(x[15])!r}"' if kind in ("hinge", "slide") else ""
    axis, damping = _text([x[12], x[13], 1.5]), abs(float(x[16]))
    return f'<joint name="{name}" type="{kind}" axis="{axis}" pos="{_text(x[9:12])}" damping="{damping!r}" {ref}/>'


def _text(values) -> str:
    return " ".join(repr(float(x)) for x in values)
