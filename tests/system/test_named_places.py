"""Names of a system: the coordinate of a name is the one whose derivative is the rate of this name."""

import numpy as np
import pytest

import gauss
from gauss.errors import StateError
from gauss.system import coordinate_rates

SCENES = ("four_bar", "free_body", "heavy_top", "cardan", "screw_jack", "turntable", "rolling_disk")


@pytest.mark.parametrize("name", SCENES)
def test_the_coordinate_of_a_name_follows_its_rate_alone(name):
    system = gauss.compile_scene(gauss.load(name))
    turning = [joint.v.start + k for joint in system.joints for k in range(joint.pair.n_v) if _turns(joint, k)]
    for coordinate in system.coordinates:
        column = system.column(coordinate)
        if column in turning:
            with pytest.raises(StateError, match="angular velocity"):
                system.entry(coordinate)
        else:
            slopes = coordinate_rates(system, system.reference.q, np.eye(system.n_v)[column])
            assert np.flatnonzero(slopes).tolist() == [system.entry(coordinate)]


def _turns(joint, rate: int) -> bool:
    """Whether a rate is a component of an angular velocity, which is no derivative of a coordinate."""
    return joint.pair.quaternion is not None and rate >= joint.pair.quaternion


@pytest.mark.parametrize("find", ["joint", "coordinate", "column", "entry", "frame"])
def test_unknown_names_are_refused_with_the_nearest(find):
    system = gauss.compile_scene(gauss.load("four_bar"))
    with pytest.raises(StateError, match="Did you mean '(B|coupler)'"):
        getattr(system, find)("couplr" if find == "frame" else "Bx")
