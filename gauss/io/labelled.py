"""Motions of every kind as xarray Datasets: named dimensions, units in the attributes, and how they were made."""

import json

import numpy as np

from gauss.analysis import energy, reactions
from gauss.io.results import joined
from gauss.io.rotors import toml_text
from gauss.rotations import AXIS_NAMES
from gauss.rotors import RotorMotion
from gauss.servo import Tracking
from gauss.simulation import Rollout, Trajectory
from gauss.simulation.provenance import library, made_by, plain, provenance, scene_text, written
from gauss.system.coordinate_names import axis_labels

RESIDUALS = "m, rad or rates of these"
COMPONENTS = ("w", *AXIS_NAMES)  # of a quaternion


def of_motion(trajectory: Trajectory, joints=()):
    """Dataset of a motion; with reactions of some joints."""
    xarray = library("xarray")
    system, (positions, rotations) = trajectory.system, trajectory.poses()
    held = {
        "time": ("time", trajectory.t, {"units": "s", "long_name": "time"}),
        **axis_labels(system),
        "body": list(system.structure.bodies),
        "axis": list(AXIS_NAMES),
        "component": list(COMPONENTS),
    }
    data: dict[str, tuple] = {
        "q": (("time", "coordinate"), trajectory.q, {"long_name": "coordinates", "units": "see coordinate_unit"}),
        "v": (("time", "rate"), trajectory.v, {"long_name": "rates of the coordinates", "units": "see rate_unit"}),
        "position": (("time", "body", "axis"), positions, {"units": "m", "long_name": "origins of the body frames"}),
        "orientation": (
            ("time", "body", "component"),
            _quaternions(rotations),
            {"units": "1", "long_name": "rotations from the body frames to world"},
        ),
    }
    data |= {name: ("time", row, {"units": "J"}) for name, row in energies(trajectory).items()}
    data |= _events(trajectory)
    if joints:
        found = [reactions(trajectory, joint) for joint in joints]
        held["joint"] = list(joints)
        for part, unit in (("force", "N"), ("moment", "N m")):
            values = np.stack([getattr(reaction, part) for reaction in found], axis=1)
            about = {"units": unit, "long_name": f"{part} of the parent on the child at the joint, world axes"}
            data[f"reaction_{part}"] = (("time", "joint", "axis"), values, about)
    return xarray.Dataset(data, held, provenance(trajectory))


def of_tracking(tracking: Tracking, joints=()):
    """Dataset of a motion under servos: that of its motion, efforts, their work, what is left of the relations, the hold."""
    found, servo = of_motion(tracking.motion, joints), tracking.servo
    data = {
        "effort": (
            ("time", "effort_name"),
            tracking.efforts,
            {"units": "see effort_unit", "long_name": "efforts of the servos"},
        ),
        "effort_work": (("time", "effort_name"), tracking.work, {"units": "J", "long_name": "work of each effort"}),
        "gap": (
            ("time", "relation"),
            tracking.residuals,
            {"units": RESIDUALS, "long_name": "residual of each relation, at its own level"},
        ),
        "hold": ("time", tracking.smallest, {"units": "1", "long_name": "smallest singular value; 0 is none"}),
    }
    found = found.assign(data).assign_coords(
        effort_name=list(servo.efforts),
        effort_unit=("effort_name", list(servo.effort_units)),
        relation=list(servo.held),
    )
    return found.assign_attrs(title=f"motion of {servo.system.scene.name} under servos", verdict=str(tracking.verdict))


def of_rotors(motion: RotorMotion):
    """Dataset of a motion of a rotor network: shafts, links, energies, events."""
    reduced = motion.reduced
    shafts, links = list(reduced.names), [link.name for link in reduced.links]
    found, events = motion.energy(), motion.events
    by_shaft = {"angle": ("rad", motion.angles), "speed": ("rad/s", motion.speeds)}
    by_shaft |= {"acceleration": ("rad/s²", motion.accelerations), "stuck": ("1", motion.stuck)}
    by_link = {"torque": ("N m", motion.torques), "slip_heat": ("J", motion.slip_heat), "mesh_heat": ("J", motion.mesh_heat)}
    by_link |= {"elastic_energy": ("J", motion.elastic), "forward": ("1", motion.forward)}
    slips = [motion.slip(name) for name in links]
    by_link["slip"] = ("1", np.stack(slips, axis=1) if slips else np.zeros((len(motion), 0)))
    data: dict[str, tuple] = {
        name: (("time", "shaft"), values, {"units": unit}) for name, (unit, values) in by_shaft.items()
    }
    data |= {name: (("time", "link"), values, {"units": unit}) for name, (unit, values) in by_link.items()}
    for name in (*found.__dataclass_fields__, "balance"):
        data[f"energy_{name}"] = ("time", getattr(found, name), {"units": "J"})
    data |= {
        "event_time": ("event", np.array([event.time for event in events], dtype=float), {"units": "s"}),
        "event_kind": ("event", np.array([event.kind for event in events], dtype=str)),
        "event_element": ("event", np.array([event.element for event in events], dtype=str)),
    }
    held = {"time": ("time", motion.t, {"units": "s", "long_name": "time"}), "shaft": shafts, "link": links}
    about = {"title": f"motion of {reduced.network.name}", "network": reduced.network.name}
    about |= written(lambda: toml_text(reduced.network), "network") | made_by()
    about |= {f"cost_{key}": plain(value) for key, value in vars(motion.stats).items()}
    return library("xarray").Dataset(data, held, about)


def of_rollout(rollout: Rollout):
    """Dataset of many motions at once, with a dimension for them."""
    system = rollout.system
    repeated = np.isin(np.arange(len(rollout.q)), rollout.repeated)
    data = {
        "q": (("motion", "time", "coordinate"), rollout.q, {"long_name": "coordinates", "units": "see coordinate_unit"}),
        "v": (("motion", "time", "rate"), rollout.v, {"long_name": "rates", "units": "see rate_unit"}),
        "steps": ("motion", rollout.steps, {"long_name": "steps accepted"}),
        "rejected": ("motion", rollout.rejected, {"long_name": "steps tried again with a shorter one"}),
        "repeated": ("motion", repeated, {"long_name": "whether it was made again by itself"}),
    }
    about = {"title": f"motions of {system.scene.name}", "scene": system.scene.name}
    held = {"time": ("time", rollout.t, {"units": "s", "long_name": "time"})} | axis_labels(system)
    return library("xarray").Dataset(data, held, about | scene_text(system.scene) | made_by())


def energies(trajectory: Trajectory) -> dict[str, np.ndarray]:
    """Energies (k,) [J] by name."""
    found = energy(trajectory)
    return {name: getattr(found, name) for name in ("kinetic", "potential", "drives", "loads", "dissipated", "balance")}


def _events(trajectory: Trajectory) -> dict:
    events = trajectory.events
    return {
        "event_time": ("event", np.array([event.t for event in events], dtype=float), {"units": "s"}),
        "event_kind": ("event", np.array([event.kind for event in events], dtype=str)),
        "event_gaps": ("event", np.array([joined(event.gaps) for event in events], dtype=str)),
        "event_loss": ("event", np.array([event.loss for event in events], dtype=float), {"units": "J"}),
        "event_impulses": ("event", np.array([json.dumps(event.impulses) for event in events], dtype=str)),
    }


def _quaternions(rotations: np.ndarray) -> np.ndarray:
    """Unit quaternions (k, n, 4), w first, of rotations (k, n, 3, 3)."""
    from scipy.spatial.transform import Rotation  # takes long to import

    turned = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return turned.reshape(*rotations.shape[:2], 4)
