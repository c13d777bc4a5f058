"""Linkages for tests: the shipped ones with their tables, random ones, and the same instant by Gauss's principle."""

import numpy as np

import gauss
from gauss.errors import LinkageError
from gauss.linkages import scene_state
from gauss.linkages.dynamics import reduced_inertia
from gauss.linkages.plane import dot, left

# Shipped linkage → its reference file, and the names of links there.
SHIPPED = {
    "four_bar": ("linkage-fourbar", {"1": "crank", "2": "coupler", "3": "rocker"}),
    "slider_crank": ("linkage-slider-crank", {"1": "crank", "2": "rod", "3": "slider"}),
    "shaper": ("linkage-rpr-shaper", {"1": "crank", "2": "block", "3": "lever", "4": "link", "5": "ram"}),
    "six_bar": ("linkage-prp-sixbar", {"1": "crank", "2": "coupler", "3": "rocker", "4": "block", "5": "slider"}),
    "scotch_yoke": ("linkage-rpp-yoke", {"1": "crank", "2": "block", "3": "yoke"}),
}
CLASS_THREE = {"1": "crank", "2": "rod", "3": "lower leg", "4": "ternary", "5": "upper leg"}
WORST_CONDITION = 10.0  # of a group of a random linkage: transmission angles above some 11°
KINDS = ("RRR", "RRP", "RPR", "PRP", "RPP", "III")


def gauss_instant(system, found, index, reference):
    """Accelerations, reactions and torque at one crank angle of a cycle, by Gauss's principle.

    Returns
    -------
    tuple of dict
        Link → (a_x, a_y, α) of the centre of mass; joint → (F_x, F_y, M) on the child, and "torque" of the drive.
    """
    state, pivot = scene_state(system, found, index, reference), found.chain.pivot.name
    rows = {c.name: c.rows for c in system.structure.constraints}
    prescribed = f"drive of {pivot}" in rows
    load = np.zeros(system.n_v)
    load[system.joint(pivot).v] = 0.0 if prescribed else found.torque[index]
    solution = gauss.solve(gauss.assemble(system, state, load=load))
    assert str(solution.status) == "solved", solution.status
    multipliers = {name: -solution.multipliers[place] for name, place in rows.items()}
    a = solution.a.reshape(-1, 6)
    accelerations = {name: a[i, [3, 4, 2]] for i, name in enumerate(system.structure.bodies)}
    forces = {joint.name: multipliers[joint.name][[3, 4, 2]] for joint in found.chain.joints}
    if prescribed:
        forces["torque"] = multipliers[f"drive of {pivot}"]
    else:  # the torque that gives the wanted acceleration; exact, for accelerations are affine in it
        inertia = reduced_inertia(found.chain, found.crank_angle[index])
        wanted = found.link(found.chain.crank.name).alpha[index]
        forces["torque"] = load[system.joint(pivot).v] + inertia * (wanted - solution.qdd[system.joint(pivot).v])
    forces[pivot][2] -= load[system.joint(pivot).v][0] + (forces["torque"][0] if prescribed else 0.0)  # goes through the pin
    return accelerations, forces


def group_instant(found, index):
    """The same numbers from the groups."""
    accelerations, forces = {}, {}
    for link in found.chain.links:
        moving = found.link(link.name)
        G = moving.point(complex(*link.com))
        a = np.broadcast_to(moving.acceleration(G), len(found))[index]
        accelerations[link.name] = np.array([a.real, a.imag, np.broadcast_to(moving.alpha, len(found))[index]])
    for joint in found.chain.joints:
        reaction = found.reaction(joint.name)
        forces[joint.name] = np.array([*reaction.force[index], reaction.moment[index]])
    forces["torque"] = found.torque[index : index + 1]
    return accelerations, forces


def difference(found, system, index, reference, scale=None) -> float:
    """Largest difference of the two routes at one crank angle: absolute, relative above 1, or to a scale of each kind."""
    pairs = list(zip(group_instant(found, index), gauss_instant(system, found, index, reference), strict=True))
    if scale is None:
        return max(apart(ours[key], theirs[key]) for ours, theirs in pairs for key in ours)
    return max(np.abs(ours[key] - theirs[key]).max() / scale(ours) for ours, theirs in pairs for key in ours)


def largest(numbers) -> float:
    """Largest of all accelerations, or of all forces and moments."""
    return max(1.0, *(np.abs(part).max() for part in numbers.values()))


def apart(ours, theirs) -> float:
    """Largest difference, absolute, relative above 1."""
    return float(np.max(np.abs(ours - theirs) / np.maximum(1.0, np.abs(theirs)), initial=0.0))


def random_linkage(rng, kinds, gravity, backwards: bool):
    """Linkage of given groups that closes at a crank angle, well away from singular positions, loaded everywhere.

    It is drawn assembled: links and joints get places in the world, and their own frames follow from these.

    Returns
    -------
    tuple
        The linkage, and its cycle of this one crank angle, at which it starts.
    """
    while True:
        linkage, angle = _draw(rng, kinds, gravity, backwards)
        try:
            found = linkage.cycle([angle])
        except LinkageError:
            continue
        if max(float(kappa.max()) for kappa in found.condition().values()) < WORST_CONDITION:
            return linkage, found


class _Board:
    """Links drawn in the world, each with a frame (p, e) of its own."""

    def __init__(self, rng, linkage):
        self.rng, self.linkage, self.frames = rng, linkage, {"ground": (0j, 1 + 0j)}

    def point(self):
        return complex(*self.rng.uniform(-1, 1, 2))

    def link(self, name):
        mass, inertia = self.rng.uniform(0.5, 5.0), self.rng.uniform(0.01, 0.5)
        self.linkage.link(name, mass, inertia, self.rng.uniform(-0.5, 0.5, 2))
        self.frames[name] = (self.point(), np.exp(1j * self.rng.uniform(-np.pi, np.pi)))

    def local(self, name, x):
        p, e = self.frames[name]
        z = (x - p) * np.conj(e)
        return z.real, z.imag

    def join(self, letter, name, one, other):
        """Joint at a random point, either way round; returns point and direction."""
        parent, child = (one, other) if self.rng.integers(2) else (other, one)
        x = self.point()
        if letter == "R":
            self.linkage.revolute(name, parent, child, self.local(parent, x), self.local(child, x))
            return x, None
        u = np.exp(1j * self.rng.uniform(-np.pi, np.pi))
        base = x - self.rng.uniform(-1, 1) * u
        angles = [float(np.angle(u / self.frames[link][1])) for link in (parent, child)]
        at, child_at = self.local(parent, base), self.local(child, x)
        self.linkage.prismatic(name, parent, child, at, angles[0], child_at, angles[1])
        return x, u


def _draw(rng, kinds, gravity, backwards):
    linkage = gauss.Linkage("random", gravity=(gravity.real, gravity.imag))
    board = _Board(rng, linkage)
    board.link("crank")
    x = board.point()
    linkage.revolute("A", "ground", "crank", board.local("ground", x), board.local("crank", x))
    speed = rng.uniform(1.0, 20.0) * (-1 if backwards else 1)
    angle = float(np.angle(board.frames["crank"][1]))
    linkage.drive("A", speed, rng.uniform(-30, 30), start=angle)
    for k, kind in enumerate(kinds):
        carriers = [str(name) for name in rng.choice(list(board.frames), 3)]
        if kind == "III":
            ternary, legs = f"t{k}", [f"{leg}{k}" for leg in "abc"]
            for name in (ternary, *legs):
                board.link(name)
            for leg, carrier in zip(legs, carriers, strict=True):
                board.join("P" if rng.uniform() < 0.2 else "R", f"O{leg}", carrier, leg)
                board.join("R", f"I{leg}", ternary, leg)
            p, e = board.frames[ternary]
            linkage.pose(ternary, (p.real, p.imag, float(np.angle(e))))
            continue
        i, j, inner = f"i{k}", f"j{k}", f"I{k}"
        board.link(i)
        board.link(j)
        outer, _ = board.join(kind[0], f"O{i}", carriers[0], i)
        at, along = board.join(kind[1], inner, i, j)
        other, guide = board.join(kind[2], f"O{j}", carriers[1], j)
        if kind in ("RRR", "RRP", "RPR"):
            if kind != "RRP" and linkage.joints[inner].child == j:
                outer, other = other, outer  # the first link of such a group is the child of its inner joint
            toward = {"RRR": left(other - outer), "RRP": guide, "RPR": along}[kind]
            linkage.mode(inner, 1 if dot(toward, (outer - other) if kind == "RPR" else (at - outer)) > 0 else -1)
    for name in list(board.frames)[1:]:
        at = tuple(rng.uniform(-0.5, 0.5, 2)) if rng.integers(2) else None
        kind = {"axes": str(rng.choice(["world", "link"])), "resisting": bool(rng.uniform() < 0.1)}
        viscous = 3.0 if rng.uniform() < 0.1 else 0.0
        linkage.load(name, rng.uniform(-100, 100, 2), rng.uniform(-20, 20), at=at, viscous=viscous, **kind)
    return linkage, angle
