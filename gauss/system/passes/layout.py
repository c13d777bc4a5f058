"""Parts with fewer joints: vectors are laid out anew, couplings of joints that are gone are gone with them."""

from dataclasses import replace

import numpy as np

from gauss.system.subsystem import Subsystem


def kept_joints(part: Subsystem, joints) -> Subsystem:
    """Part with some of its joints, perhaps placed elsewhere; its tree has still to be found."""
    kept, q, v, q_places, v_places = [], 0, 0, [], []
    for joint in joints:
        q_places.append(part.q[joint.q])
        v_places.append(part.v[joint.v])
        kept.append(replace(joint, q=slice(q, q + joint.pair.n_q), v=slice(v, v + joint.pair.n_v)))
        q, v = q + joint.pair.n_q, v + joint.pair.n_v
    names = {joint.name for joint in kept}
    nothing = np.zeros(0, dtype=int)
    return replace(
        part,
        joints=tuple(kept),
        couplings=tuple(c for c in part.couplings if {c.driver, c.driven} <= names),
        q=np.concatenate([nothing, *q_places]),
        v=np.concatenate([nothing, *v_places]),
        tree=(),
    )
