"""Scenes in MuJoCo, as gauss exports them, at their fastest."""

import mujoco
import numpy as np

from gauss.dynamics.kinematics import kinematics
from gauss.io.mjcf.tree import limb, mujoco_state, spanning_tree
from gauss.io.mjcf.write import to_mjcf
from gauss.system import System

METHODS = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
}
KEPT = ("GRAVITY", "CONSTRAINT", "EQUALITY", "SPRING", "DAMPER", "PASSIVE", "ACTUATION", "CLAMPCTRL")


class MujocoModel:
    """A system in MuJoCo."""

    def __init__(self, system: System):
        self.system = system
        self.model = mujoco.MjModel.from_xml_string(to_mjcf(system.scene))
        for name, bit in mujoco.mjtDisableBit.__members__.items():
            if name.startswith("mjDSBL_") and name.removeprefix("mjDSBL_") not in KEPT:
                self.model.opt.disableflags |= int(bit)
        self.data, limbs = mujoco.MjData(self.model), [limb(system, *edge) for edge in spanning_tree(system.scene)[0]]
        self.start = mujoco_state(system, limbs, kinematics(system, system.initial_state()))
        self.bodies = [self.model.body(name).id for name in system.structure.bodies]

    def centres(self, method: str, step: float, duration: float) -> np.ndarray:
        """Centres of mass (n, 3) at the end."""
        model, data = self.model, self.data
        model.opt.timestep, model.opt.integrator = step, METHODS[method]
        model.eq_solref[:] = (2.0 * step, 1.0)
        model.eq_solimp[:, :2] = 0.9999
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = self.start
        mujoco.mj_step(model, data, nstep=round(duration / step))
        mujoco.mj_kinematics(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number or not np.isfinite(data.qpos).all():
            raise ArithmeticError("MuJoCo: accelerations out of range")
        return data.xipos[self.bodies].copy()
