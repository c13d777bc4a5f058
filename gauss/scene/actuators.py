"""Ready actuators with states of their own: motors, hydraulic cylinders, PI controllers, filters, muscles, bristle friction.

Each function adds states (:meth:`gauss.Scene.state`) and loads to a scene, and returns the load. Laws are traced.
"""

from collections.abc import Callable

from gauss import math
from gauss.scene.builder import name_of
from gauss.scene.loads import Drive, StateLaw
from gauss.scene.scene import Scene
from gauss.scene.values import arguments, number, text

WIDTH = 0.45  # of the force–length curve of a muscle, in optimal lengths (Zajac 1989)
ECCENTRIC = 1.4  # largest force of a lengthening muscle, in isometric ones
CURVATURE = 0.25  # of Hill's force–velocity curve, a/F₀


def _signal(signal, what: str, unit: str) -> Callable:
    """Law (t, motion) of a number, or of a law of one or two arguments."""
    if not callable(signal):
        value = number(signal, what, unit)
        return lambda t, motion: value
    return signal if arguments(signal) > 1 else lambda t, motion: signal(t)


def _positive(what: str, **given: float):
    for name, value in given.items():
        number(value, f"{what}: {name}", "SI units", positive=True)


def _numbers(what: str, **given: float):
    for name, value in given.items():
        number(value, f"{what}: {name}", "SI units")


def dc_motor(
    scene: Scene, name: str, joint, voltage=0.0, *, resistance: float, inductance: float, constant: float, ratio: float = 1.0
) -> Drive:
    """Direct-current motor on a joint: L i̇ = u − R i − k n q̇, torque k n i; the current i is the state ``"name current"``.

    Parameters
    ----------
    scene : Scene
        Scene with the joint.
    name : str
        Name of the motor.
    joint : str or Joint
        Joint of one freedom.
    voltage : float or callable
        Voltage u [V]: a constant, law(t) or law(t, motion).
    resistance, inductance : float
        Of the winding, R [Ω], L [H].
    constant : float
        Torque constant k [N m/A], and the same of the back-electromotive force [V s/rad].
    ratio : float
        Turns of the motor per turn of the joint, n.

    Returns
    -------
    Drive
        Drive of the joint.

    Examples
    --------
    >>> import gauss
    >>> from gauss.scene.actuators import dc_motor
    >>> scene = gauss.load("pendulum")
    >>> motor = dc_motor(scene, "motor", "A", voltage=12.0, resistance=0.5, inductance=1e-3, constant=0.1)
    >>> list(scene.states)
    ['motor current']
    """
    what = f"motor {text(name, 'name of a motor')!r}"
    _positive(what, resistance=resistance, inductance=inductance, constant=constant)
    _numbers(what, ratio=ratio)
    joint, current, law = name_of(joint), f"{name} current", _signal(voltage, f"{what}: voltage", "V")

    def rate(t, motion):
        back = constant * ratio * motion.rate(joint)
        return (law(t, motion) - resistance * motion.rate(current) - back) / inductance

    scene.require_joint(joint, what)
    scene.state(current, rate)
    return scene.drive(joint, torque=lambda t, motion: constant * ratio * motion.rate(current), name=name)


def pi_controller(
    scene: Scene, name: str, joint, target, *, proportional: float, integral: float, derivative: float = 0.0, limit=None
) -> Drive:
    """Controller of a coordinate: effort P e + I ∫ e dt − D q̇, e = target − q; ∫ e dt is the state ``"name integral"``.

    Parameters
    ----------
    scene : Scene
        Scene with the joint.
    name : str
        Name of the controller.
    joint : str or Joint
        Joint of one freedom.
    target : float or callable
        Coordinate that is asked for [rad, m]: a constant, law(t) or law(t, motion).
    proportional, integral, derivative : float
        Gains P [N m/rad, N/m], I [N m/(rad s), N/(m s)] and D [N m s/rad, N s/m].
    limit : float, optional
        Largest effort [N m, N].

    Returns
    -------
    Drive
        Drive of the joint.

    Examples
    --------
    >>> import gauss
    >>> from gauss.scene.actuators import pi_controller
    >>> scene = gauss.load("pendulum")
    >>> drive = pi_controller(scene, "hold", "A", 0.5, proportional=80.0, integral=40.0, derivative=8.0)
    >>> round(float(gauss.simulate(scene, 2.0, rtol=1e-8).coordinate("A")[-1]), 2)
    0.49
    """
    what = f"controller {text(name, 'name of a controller')!r}"
    _numbers(what, proportional=proportional, integral=integral, derivative=derivative)
    joint, stored, law = name_of(joint), f"{name} integral", _signal(target, f"{what}: target", "rad or m")

    def effort(t, motion):
        error = law(t, motion) - motion.coordinate(joint)
        return proportional * error + integral * motion.rate(stored) - derivative * motion.rate(joint)

    scene.require_joint(joint, what)
    scene.state(stored, lambda t, motion: law(t, motion) - motion.coordinate(joint))
    return scene.drive(joint, torque=effort, limit=limit, name=name)


def low_pass(scene: Scene, name: str, signal, time: float, start: float = 0.0) -> StateLaw:
    """Filter of first order: ẋ = (signal − x) / time; its output is the state of its name.

    Parameters
    ----------
    scene : Scene
        Scene.
    name : str
        Name of the filter, and of its state.
    signal : callable
        law(t) or law(t, motion).
    time : float
        Time constant [s].
    start : float
        Output at the start.

    Returns
    -------
    StateLaw
        Law of the state.
    """
    what = f"filter {text(name, 'name of a filter')!r}"
    _positive(what, time=time)
    law = _signal(signal, f"{what}: signal", "its unit")
    return scene.state(name, lambda t, motion: (law(t, motion) - motion.rate(name)) / time, start)


def muscle(
    scene: Scene,
    name: str,
    joint,
    excitation,
    *,
    force: float,
    arm: float,
    optimal_length: float,
    fastest: float = 10.0,
    activation_time: float = 0.015,
) -> Drive:
    """Muscle of Hill's type on a joint, without a tendon; its activation a is the state ``"name activation"``.

    ȧ = (u − a) / τ, effort −r F₀ a f(l) g(l̇) with l = l₀ − r q: f is a Gauss curve about l₀, g Hill's hyperbola with a limit
    where the muscle lengthens (Zajac, Muscle and tendon, 1989).

    Parameters
    ----------
    scene : Scene
        Scene with the joint.
    name : str
        Name of the muscle.
    joint : str or Joint
        Joint of one freedom.
    excitation : float or callable
        Excitation u from 0 to 1: a constant, law(t) or law(t, motion).
    force, arm, optimal_length : float
        Largest isometric force F₀ [N], constant moment arm r [m], positive where the muscle turns the joint forward, and
        length l₀ of the largest force, at q = 0 [m].
    fastest : float
        Largest shortening velocity, in optimal lengths per second.
    activation_time : float
        Time constant τ of the activation [s].

    Returns
    -------
    Drive
        Drive of the joint.

    Examples
    --------
    >>> import gauss
    >>> from gauss.scene.actuators import muscle
    >>> scene = gauss.load("pendulum")
    >>> flexor = muscle(scene, "flexor", "A", 0.8, force=500.0, arm=0.03, optimal_length=0.1)
    >>> list(scene.states)
    ['flexor activation']
    """
    what = f"muscle {text(name, 'name of a muscle')!r}"
    _positive(what, force=force, optimal_length=optimal_length, fastest=fastest, activation_time=activation_time)
    _numbers(what, arm=arm)
    joint, active = name_of(joint), f"{name} activation"

    def effort(t, motion):
        stretch = arm * motion.coordinate(joint) / optimal_length
        shortening = arm * motion.rate(joint) / (optimal_length * fastest)  # share of the largest velocity
        slow = math.clip(shortening, 0.0, 1.0)
        concentric = (1.0 - slow) / (1.0 + slow / CURVATURE)
        lengthening = math.clip(-shortening, 0.0, 1.0)
        slope = (1.0 + 1.0 / CURVATURE) / (ECCENTRIC - 1.0)  # of both branches at rest the same
        eccentric = ECCENTRIC - (ECCENTRIC - 1.0) / (1.0 + slope * lengthening)
        velocity = math.where(shortening > 0.0, concentric, eccentric)
        return arm * force * motion.rate(active) * math.exp(-((stretch / WIDTH) ** 2)) * velocity

    scene.require_joint(joint, what)
    low_pass(scene, active, excitation, activation_time)
    return scene.drive(joint, torque=effort, name=name)


def lugre_friction(
    scene: Scene,
    name: str,
    joint,
    *,
    coulomb: float,
    static: float,
    stribeck: float,
    stiffness: float,
    damping: float = 0.0,
    viscous: float = 0.0,
) -> Drive:
    """Bristle friction of a joint, with the state ``"name bristle"``.

    z is that state: ``ż = v − σ₀ |v| z / g(v)``, effort −(σ₀ z + σ₁ ż + σ₂ v),
    g(v) = F_c + (F_s − F_c) exp(−(v / v_s)²) (Canudas de Wit, Olsson, Åström, Lischinsky, A new model for control of systems
    with friction, IEEE Transactions on Automatic Control 40, 1995).

    Parameters
    ----------
    scene : Scene
        Scene with the joint.
    name : str
        Name of the friction.
    joint : str or Joint
        Joint of one freedom.
    coulomb, static : float
        Friction when it slips fast, F_c, and at breakaway, F_s [N m, N].
    stribeck : float
        Stribeck velocity v_s [rad/s, m/s].
    stiffness, damping, viscous : float
        Of the bristles σ₀ [N m/rad, N/m] and σ₁ [N m s/rad, N s/m], and viscous friction σ₂.

    Returns
    -------
    Drive
        Drive of the joint.

    Examples
    --------
    >>> import gauss
    >>> from gauss.scene.actuators import lugre_friction
    >>> scene = gauss.load("pendulum")
    >>> bristles = lugre_friction(
    ...     scene, "bristles", "A", coulomb=0.5, static=0.8, stribeck=0.05, stiffness=1e3, damping=10.0
    ... )
    >>> list(scene.states)
    ['bristles bristle']
    """
    what = f"friction {text(name, 'name of a friction')!r}"
    _positive(what, coulomb=coulomb, static=static, stribeck=stribeck, stiffness=stiffness)
    _numbers(what, damping=damping, viscous=viscous)
    joint, bristle = name_of(joint), f"{name} bristle"

    def rate(t, motion):
        v = motion.rate(joint)
        g = coulomb + (static - coulomb) * math.exp(-((v / stribeck) ** 2))
        return v - stiffness * math.abs(v) * motion.rate(bristle) / g

    def effort(t, motion):
        v = motion.rate(joint)
        return -(stiffness * motion.rate(bristle) + damping * rate(t, motion) + viscous * v)

    scene.require_joint(joint, what)
    scene.state(bristle, rate)
    return scene.drive(joint, torque=effort, name=name)


def hydraulic_cylinder(
    scene: Scene,
    name: str,
    joint,
    valve=0.0,
    *,
    area: float,
    rod_area: float,
    volume: float,
    bulk_modulus: float,
    supply: float,
    flow: float,
    tank: float = 0.0,
    leakage: float = 0.0,
    pressure: float | None = None,
) -> Drive:
    """Cylinder with a four-way valve, with the states ``"name pressure"`` and ``"name rod pressure"``.

    ṗ₁ = β (Q₁ − A₁ q̇ − c (p₁ − p₂)) / (V + A₁ q), ṗ₂ = β (Q₂ + A₂ q̇ + c (p₁ − p₂)) / (V − A₂ q), force A₁ p₁ − A₂ p₂;
    flows K u √Δp from the supply and to the tank, by the sign of u (Merritt, Hydraulic Control Systems, 1967, ch. 5 and 6).
    The root is smooth within a millionth of the supply pressure.

    Parameters
    ----------
    scene : Scene
        Scene with the joint.
    name : str
        Name of the cylinder.
    joint : str or Joint
        Joint of one freedom, which the piston extends.
    valve : float or callable
        Opening u of the valve from −1 to 1: a constant, law(t) or law(t, motion).
    area, rod_area : float
        Areas of the piston A₁ and of its side with the rod A₂ [m²].
    volume : float
        Volume V of oil on each side at q = 0, lines included [m³].
    bulk_modulus : float
        Bulk modulus of the oil β [Pa].
    supply, tank : float
        Pressures of the supply and of the tank [Pa].
    flow : float
        Flow constant K of the open valve [m³/(s √Pa)].
    leakage : float
        Leakage past the piston c [m³/(s Pa)].
    pressure : float, optional
        Both pressures at the start [Pa]; the mean of supply and tank when not given.

    Returns
    -------
    Drive
        Drive of the joint.

    Examples
    --------
    >>> import gauss
    >>> from gauss.scene import actuators
    >>> press = gauss.Scene("press", gravity=(0, 0, 0))
    >>> slide = press.prismatic("slide", "ground", press.body("ram", 50.0, (1.0, 1.0, 1.0)), axis=(1, 0, 0))
    >>> oil = {"volume": 5e-4, "bulk_modulus": 1.4e9, "supply": 2e7, "flow": 1e-7}
    >>> drive = actuators.hydraulic_cylinder(press, "lift", slide, 0.5, area=1e-3, rod_area=5e-4, **oil)
    >>> round(float(gauss.simulate(press, 0.5).v[-1, 0]), 3)  # m/s
    0.214
    """
    what = f"cylinder {text(name, 'name of a cylinder')!r}"
    _positive(what, area=area, rod_area=rod_area, volume=volume, bulk_modulus=bulk_modulus, flow=flow)
    _numbers(what, supply=supply, tank=tank, leakage=leakage)
    _positive(what, supply=supply - tank)
    joint, head, rod, law = name_of(joint), f"{name} pressure", f"{name} rod pressure", _signal(valve, f"{what}: valve", "1")
    smooth = (1e-6 * supply) ** 2

    def through(u, drop):
        return flow * u * drop / math.sqrt(math.sqrt(drop * drop + smooth))

    def chamber(t, motion, sign):
        """Rate of the pressure of the head (1) or the rod (−1) side."""
        own, other, size = (head, rod, area) if sign > 0 else (rod, head, rod_area)
        u, p = sign * law(t, motion), motion.rate(own)
        inflow = math.where(u > 0.0, through(u, supply - p), through(u, p - tank))
        moved, lost = sign * size * motion.rate(joint), leakage * (p - motion.rate(other))
        return bulk_modulus * (inflow - moved - lost) / (volume + sign * size * motion.coordinate(joint))

    scene.require_joint(joint, what)
    start = 0.5 * (supply + tank) if pressure is None else pressure
    scene.state(head, lambda t, motion: chamber(t, motion, 1.0), start)
    scene.state(rod, lambda t, motion: chamber(t, motion, -1.0), start)
    return scene.drive(joint, torque=lambda t, motion: area * motion.rate(head) - rod_area * motion.rate(rod), name=name)
