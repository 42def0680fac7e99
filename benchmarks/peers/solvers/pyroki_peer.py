"""pyroki: nonlinear least squares in JAX, compiled for the CPU, single precision as it ships.

It starts at the request's q, and its rest term holds on to that. Settings: position_weight, orientation_weight,
rest_weight, damping, iterations.
"""

import os
from typing import Any

os.environ.setdefault("JAX_PLATFORMS", "cpu")

import jax
import jax.numpy as jnp
import jax_dataclasses as jdc
import jaxlie
import jaxls
import numpy as np
import pyroki as pk
import yourdfpy

from benchmarks.peers.model import WRISTS, Model, quaternion


class Pyroki:
    def __init__(self, model: Model, settings: dict[str, Any]) -> None:
        urdf = yourdfpy.URDF.load(str(model.urdf), load_meshes=False, build_collision_scene_graph=False)
        self._robot = pk.Robot.from_urdf(urdf)
        names = list(self._robot.joints.actuated_names)
        self._places = np.array([names.index(name) for name in model.joint_names])
        self._links = np.array([self._robot.links.names.index(name) for name in WRISTS])
        self._solve = _solver(self._links, settings)

    def solve(self, left: np.ndarray, right: np.ndarray, q: np.ndarray) -> np.ndarray:
        position = np.empty(len(q))
        position[self._places] = q
        rotations = np.array([quaternion(left[:3, :3]), quaternion(right[:3, :3])])
        points = np.array([left[:3, 3], right[:3, 3]])
        return np.asarray(self._solve(self._robot, rotations, points, position), dtype=float)[self._places]

    def fk(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        position = np.empty(len(q))
        position[self._places] = q
        poses = jaxlie.SE3(self._robot.forward_kinematics(jnp.asarray(position))).as_matrix()
        left, right = (np.asarray(poses[link], dtype=float) for link in self._links)
        return left, right


def _solver(links: np.ndarray, settings: dict[str, Any]) -> Any:
    @jdc.jit
    def solve(robot: Any, wxyz: Any, points: Any, start: Any) -> Any:
        variable = robot.joint_var_cls
        targets = jaxlie.SE3.from_rotation_and_translation(jaxlie.SO3(wxyz), points)
        costs = [
            pk.costs.pose_cost_analytic_jac(
                jax.tree.map(lambda leaf: leaf[None], robot),
                variable(jnp.full(targets.get_batch_axes(), 0)),
                targets,
                jnp.asarray(links),
                pos_weight=settings["position_weight"],
                ori_weight=settings["orientation_weight"],
            ),
            pk.costs.rest_cost(variable(0), rest_pose=start, weight=settings["rest_weight"]),
            pk.costs.limit_constraint(robot, variable(0)),
        ]
        problem = jaxls.LeastSquaresProblem(costs, [variable(0)])
        solution = problem.analyze().solve(
            initial_vals=jaxls.VarValues.make([variable(0).with_value(start)]),
            verbose=False,
            linear_solver="dense_cholesky",
            trust_region=jaxls.TrustRegionConfig(lambda_initial=settings["damping"]),
            termination=jaxls.TerminationConfig(max_iterations=settings["iterations"]),
        )
        return solution[variable(0)]

    return solve


def build(model: Model, settings: dict[str, Any]) -> Pyroki:
    return Pyroki(model, settings)
