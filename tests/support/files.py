"""Scenes from files, and what tests compare of them; the command line."""

import warnings

import numpy as np
from typer.testing import CliRunner

import gauss
from gauss import cli
from gauss.errors import NotImportedWarning


def linear(scene) -> dict[str, np.ndarray]:
    """Acceleration of the centre of mass of every body at the start [m/s²]."""
    system = gauss.compile_scene(scene)
    solution = gauss.solve(gauss.assemble(system, system.initial_state()))
    return dict(zip(system.structure.bodies, solution.a.reshape(-1, 6)[:, 3:], strict=True))


def reversed_joints(scene):
    """The same mechanism, each joint named from its child to its parent."""
    turned = gauss.Scene(scene.name)
    for body in scene.bodies.values():
        turned.add(body)
    for j in scene.joints.values():
        turned.joint(
            j.name, j.kind, j.child, j.parent, at=j.at, axis=j.axis, rotation=j.rotation, pitch=j.pitch, frame=j.frame
        )
    return turned


def quietly(path, **options) -> gauss.Scene:
    """Scene of a file, without warnings of what is not read."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotImportedWarning)
        return gauss.load(path, **options)


def call(*arguments):
    """Result of a call of the command line."""
    return CliRunner().invoke(cli.app, [str(argument) for argument in arguments])
