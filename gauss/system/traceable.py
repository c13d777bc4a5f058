"""Which systems are compiled: the rule, and the reasons against."""

import inspect

from gauss.scene import Drive, JointSpring

LARGEST = 50  # bodies: straight-line code and its compile time grow with the scene and stop paying beyond


def obstacles(system) -> list[str]:
    """Reasons why the forward dynamics of a system are not compiled; none means that they are."""
    reasons = []
    if any(index < len(system.joints) for index in system.structure.closures):
        reasons.append("loops")
    if system.structure.n_bodies > LARGEST:
        reasons.append(f"more than {LARGEST} bodies")
    for bound in system.loads:
        load = bound.load
        if isinstance(load, Drive) and callable(load.effort) and len(inspect.signature(load.effort).parameters) > 1:
            reasons.append(f"the law of {load.name!r} asks where bodies are")
        elif not isinstance(load, Drive | JointSpring):
            reasons.append(f"load {load.name!r} acts on bodies")
    return reasons
