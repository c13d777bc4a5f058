"""Subsystems with fewer joints: new slices of q and v, without the couplings of removed joints."""

from dataclasses import replace

import numpy as np

from gauss.system.subsystem import Subsystem


def kept_joints(subsystem: Subsystem, joints) -> Subsystem:
    """Subsystem with some of its joints, perhaps with other frames; its tree is left empty."""
    kept, q, v, q_places, v_places = [], 0, 0, [], []
    for joint in joints:
        q_places.append(subsystem.q[joint.q])
        v_places.append(subsystem.v[joint.v])
        kept.append(replace(joint, q=slice(q, q + joint.pair.n_q), v=slice(v, v + joint.pair.n_v)))
        q, v = q + joint.pair.n_q, v + joint.pair.n_v
    names = {joint.name for joint in kept}
    nothing = np.zeros(0, dtype=int)
    return replace(
        subsystem,
        joints=tuple(kept),
        couplings=tuple(c for c in subsystem.couplings if {c.driver, c.driven} <= names),
        q=np.concatenate([nothing, *q_places]),
        v=np.concatenate([nothing, *v_places]),
        tree=(),
    )
