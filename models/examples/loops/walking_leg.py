"""
A walking leg
=============

Theo Jansen's leg: seven bodies, ten pins, three loops, one freedom. A motor turns the crank, and the foot follows its
well-known path.
"""

import numpy as np

import gauss
from gauss import view

PINS = ("O ground crank", "P crank j", "P crank k", "Q ground upper", "Q ground c")
PINS += ("X j upper", "Y upper f", "Z k c", "Z c lower", "W f lower")


def meet(p, q, r, s):
    """Point at the distances r from p and s from q, to the left of the way from p to q."""
    along = np.subtract(q, p)
    d = np.hypot(*along)
    x = (d**2 + r**2 - s**2) / (2 * d)
    return np.add(p, (x * along + np.sqrt(r**2 - x**2) * np.array([-along[1], along[0]])) / d)


def leg(scene, unit=0.01):
    """Add the bars in the plane x, z, as drawn with the crank to the right."""
    at = {"O": np.zeros(2), "P": np.array([15.0, 0]), "Q": np.array([-38.0, -7.8])}
    at["X"] = meet(at["Q"], at["P"], 41.5, 50.0)
    at["Y"] = meet(at["Q"], at["X"], 40.1, 55.8)
    at["Z"] = meet(at["P"], at["Q"], 61.9, 39.3)
    at["W"] = meet(at["Z"], at["Y"], 36.7, 39.4)
    at["foot"] = meet(at["Z"], at["W"], 49.0, 65.7)
    place = {name: unit * np.array([x, 0.0, z]) for name, (x, z) in at.items()}
    for name, points in {"crank": "OP", "j": "PX", "upper": "QXY", "k": "PZ", "c": "QZ", "f": "YW", "lower": "ZW"}.items():
        corners = [place[point] for point in points] + ([place["foot"]] if name == "lower" else [])
        size = max(np.linalg.norm(a - b) for a in corners for b in corners)
        middle = np.mean(corners, axis=0) - corners[0]
        scene.body(name, size, (size**3 / 12,) * 3, com=middle, position=corners[0])
    for pin in PINS:
        point, one, other = pin.split()
        scene.revolute(pin, one, other, at=place[point], axis=(0, 1, 0))
    scene.frame("foot", "lower", position=place["foot"] - place["Z"])


walker = gauss.Scene("walking leg")
leg(walker)
walker.drive("O ground crank", speed=2 * np.pi)  # a turn in a second
motion = gauss.simulate(walker, 1.0, rtol=1e-9, atol=1e-9, times=np.linspace(0, 1, 201))
foot = motion.body("foot").position
print("step length", np.ptp(foot[:, 0]), "m, lift", np.ptp(foot[:, 2]), "m")
print("driving torque up to", abs(gauss.drive_forces(motion, "O ground crank")).max(), "N m")
figure = view.plot_stroboscope(motion, flashes=5)
figure.axes[0].plot(foot[:, 0], foot[:, 2], color="crimson")
