"""Answers about a motion are those of its samples: once one is kept, the samples cannot be changed in place."""

import numpy as np
import pytest

import gauss


@pytest.mark.parametrize("ask", [gauss.energy, lambda motion: gauss.reactions(motion, "A")], ids=["energy", "reactions"])
def test_samples_are_read_only_once_an_answer_is_kept(ask):
    motion = gauss.simulate(gauss.load("double_pendulum"), 0.1, times=np.linspace(0.0, 0.1, 5), progress=False)
    motion.q[:] += 0.0  # nothing is kept yet
    ask(motion)
    for samples in (motion.t, motion.q, motion.v, motion.work):
        with pytest.raises(ValueError, match="read-only"):
            samples += 0.1
