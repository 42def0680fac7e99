"""The robot and its surroundings: floor, light, sky, one motor per hinge, and two targets one can see and drag.

Colours are the same everywhere: left is blue, right is orange, a target is translucent, a wrist is solid, and axes are
red, green, blue for x, y, z.
"""

import mujoco
import numpy as np

from ik_proto.robots import RobotDescription
from sim_client.model import WRIST_SITES, compile_spec, load_spec
from sim_client.motors import replace_motors

PHYSICS_PERIOD = 0.005
"""Time step of the physics [s]."""

TARGET_BODIES = ("target_left", "target_right")
"""Names of the mocap bodies that show the targets, left and right."""

COLOURS = ((0.10, 0.45, 0.95), (0.98, 0.50, 0.05))
"""Red, green, blue of everything that belongs to the left and to the right arm."""

_AXIS_LENGTH = 0.07
_AXIS_RADIUS = 0.003
_OFFSCREEN = (1280, 960)


def build_scene(description: RobotDescription) -> mujoco.MjModel:
    """Build the model that is simulated.

    Args:
        description: The robot.

    Returns:
        A compiled model whose actuators are named after their joints and take kp q* + tau_ff [N m]; see `motors`.

    Raises:
        RobotError: The description does not fit its model file.
    """
    spec = load_spec(description)
    spec.option.timestep = PHYSICS_PERIOD
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST  # The motors' damping counts on it.
    replace_motors(spec, description)
    _add_surroundings(spec)
    for name, colour in zip(TARGET_BODIES, COLOURS, strict=True):
        _add_target(spec, name, colour)
    for name, colour in zip(WRIST_SITES, COLOURS, strict=True):
        _show_wrist(spec.site(name), colour)
    return compile_spec(spec, description)


def _add_surroundings(spec: mujoco.MjSpec) -> None:
    spec.visual.global_.offwidth, spec.visual.global_.offheight = _OFFSCREEN
    # As coarse as still looks round, and without shadows and reflections, each of which renders the scene once more:
    # most machines without a display render on the processor.
    spec.visual.quality.numslices, spec.visual.quality.numstacks = 20, 12
    spec.visual.headlight.ambient = [0.35, 0.35, 0.37]
    spec.visual.headlight.diffuse = [0.35, 0.35, 0.35]
    spec.visual.headlight.specular = [0.1, 0.1, 0.1]
    spec.add_texture(
        name="scene_sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.72, 0.80, 0.88],
        rgb2=[0.30, 0.38, 0.48],
        width=256,
        height=1536,
    )
    spec.add_texture(
        name="scene_floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.62, 0.65, 0.68],
        rgb2=[0.56, 0.59, 0.62],
        width=512,
        height=512,
    )
    textures = [""] * mujoco.mjtTextureRole.mjNTEXROLE
    textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "scene_floor"
    spec.add_material(name="scene_floor", textures=textures, texrepeat=[4.0, 4.0], texuniform=True, reflectance=0.0)
    world = spec.worldbody
    world.add_geom(
        name="scene_floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0.0, 0.0, 0.05],
        material="scene_floor",
        contype=1,
        conaffinity=0,
    )
    world.add_light(
        name="scene_light",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[1.5, 1.0, 3.0],
        dir=[-0.45, -0.35, -1.0],
        diffuse=[0.6, 0.6, 0.58],
        castshadow=False,
    )


def _add_target(spec: mujoco.MjSpec, name: str, colour: tuple[float, float, float]) -> None:
    body = spec.worldbody.add_body(name=name, mocap=True)
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[0.035, 0.0, 0.0],
        rgba=[*colour, 0.5],
        contype=0,
        conaffinity=0,
        group=1,
    )
    for axis in range(3):
        end = np.zeros(3)
        end[axis] = _AXIS_LENGTH
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_CAPSULE,
            fromto=[0.0, 0.0, 0.0, *end],
            size=[_AXIS_RADIUS, 0.0, 0.0],
            rgba=[*np.eye(3)[axis], 0.9],
            contype=0,
            conaffinity=0,
            group=1,
        )


def _show_wrist(site: mujoco.MjsSite, colour: tuple[float, float, float]) -> None:
    site.type = mujoco.mjtGeom.mjGEOM_SPHERE
    site.size = [0.014, 0.014, 0.014]
    site.rgba = [*colour, 1.0]
    site.group = 1
