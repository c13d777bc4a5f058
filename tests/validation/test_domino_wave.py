"""Speed of a row of dominoes against the theory of dominoes that lean on each other (van Leeuwen, Am. J. Phys. 78, 2010).

The theory (arXiv:physics/0401018): each domino turns about the lower edge in front of it, which stays; it hits the next one
with its upper edge, without restitution; all those hit stay in contact, and slide on each other by Coulomb's law, in impacts
as well. The angle of the foremost therefore says where all are: one equation of motion and one of impact for the whole row,
which is what impacts of many bodies at once give while no contact opens. In the rows chosen its floor only pushes, with a
coefficient of friction below ten; of dominoes 48 mm high, 7.5 mm thick, 16 mm apart, with a friction of 0.2, it asks for a
floor that pulls in impacts, and there the two differ.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import gauss
from benchmarks.free_bodies import floor, free_body

pytestmark = pytest.mark.slow

G = 9.81
COUNT, PUSH, WIDTH, ROUGH = 14, 4.0, 0.04, 10.0  # dominoes, rate of the first [rad/s], width [m], friction of the floor
IMPACT = 1.0  # of steps: what time stepping knows of the times of impacts
SPEED = 2e-3  # relative, of the wave over the last three dominoes: a fifth of the longest step in a tenth of a second
THICK, HIGH = 0.01, 0.1  # [m]
ROWS = [(0.06, 0.3), (0.05, 0.2), (0.04, 0.1), (0.03, 0.0)]  # pitch [m], friction between dominoes


def leaning(angle: float, count: int, pitch: float, friction: float):
    """Angles of dominoes of which the foremost has an angle, their first and second derivatives by it, and weights.

    A tip lies on the back of the next domino: h sin(θ − θ') = p cos θ' − d. The weights are those of the torques in a sum
    that no force N of a contact enters: N (r − μ d) on a domino hit at a height r along its back, and
    −N h (cos(θ − θ') + μ sin(θ − θ')) on the one that hits it.
    """
    angles, first, second, weights = np.full(count, angle), np.ones(count), np.zeros(count), np.ones(count)
    for i in range(count - 2, -1, -1):
        t = angles[i + 1]
        lean = np.arcsin((pitch * np.cos(t) - THICK) / HIGH)
        sine, cosine = np.sin(lean), np.cos(lean)
        slope = -pitch * np.sin(t) / (HIGH * cosine)  # of the lean
        curve = -pitch * np.cos(t) / (HIGH * cosine) + slope**2 * sine / cosine
        angles[i] = t + lean
        first[i] = first[i + 1] * (1.0 + slope)
        second[i] = second[i + 1] * (1.0 + slope) + first[i + 1] ** 2 * curve
        height = HIGH * cosine - pitch * np.sin(t)
        weights[i] = weights[i + 1] * (height - friction * THICK) / (HIGH * (cosine + friction * sine))
    return angles, first, second, weights


def hits(pitch: float, friction: float) -> np.ndarray:
    """Times at which the dominoes hit the next one, by theory."""
    reach = np.arcsin((pitch - THICK) / HIGH)
    inertia = (HIGH * HIGH + THICK * THICK) / 3.0  # of a unit of mass, about the edge

    def reached(t, y, count):
        return y[0] - reach

    def fall(t, y, count):
        angles, first, second, weights = leaning(y[0], count, pitch, friction)
        torques = 0.5 * G * (HIGH * np.sin(angles) - THICK * np.cos(angles))
        return y[1], weights @ (torques / inertia - y[1] ** 2 * second) / (weights @ first)

    reached.terminal = True
    times, rate = [0.0], PUSH
    for count in range(1, COUNT):
        motion = solve_ivp(fall, (0.0, 5.0), (0.0, rate), rtol=1e-9, atol=1e-11, events=reached, args=(count,))
        assert motion.status == 1, "a domino falls back"
        times.append(times[-1] + motion.t[-1])
        before = leaning(reach, count, pitch, friction)[1] * motion.y[1, -1]
        _, first, _, weights = leaning(0.0, count + 1, pitch, friction)
        rate = weights[:-1] @ before / (weights @ first)
    return np.array(times[1:])


def row(pitch: float, friction: float) -> gauss.Scene:
    """Dominoes on a floor that is rough, the first of which turns about its edge."""
    scene = floor("row of dominoes")
    for k in range(COUNT):
        rate = (0.5 * HIGH * PUSH, 0.0, 0.5 * THICK * PUSH, 0.0, PUSH, 0.0) if not k else (0.0,) * 6
        free_body(scene, f"domino {k}", (THICK * THICK + HIGH * HIGH) / 12.0, (pitch * k, 0.0, 0.5 * HIGH), rate=rate)
        scene.box(f"tile {k}", f"domino {k}", (THICK, WIDTH, HIGH))
        scene.contact(f"foot {k}", f"tile {k}", "floor", friction=ROUGH)
    scene.contacts_all(friction=friction)
    return scene


@pytest.mark.parametrize("step", [1e-3, 2.5e-4])
@pytest.mark.parametrize(("pitch", "friction"), ROWS)
def test_a_row_of_dominoes_topples_at_the_speed_of_theory(pitch, friction, step):
    expected = hits(pitch, friction)
    motion = gauss.simulate(row(pitch, friction), expected[-1] + 0.02, integrator="time_stepping", step=step, progress=False)
    q = motion.q.reshape(len(motion.t), COUNT, 7)
    angles = np.maximum.accumulate(2.0 * np.arctan2(q[..., 5], q[..., 3]))
    reach = np.arcsin((pitch - THICK) / HIGH)
    found = np.array([np.interp(reach, angle, motion.t) for angle in angles.T[:-1]])
    assert np.abs(found - expected).max() < IMPACT * step
    assert found[-1] - found[-4] == pytest.approx(expected[-1] - expected[-4], rel=SPEED)
