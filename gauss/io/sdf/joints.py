"""Joints of SDFormat models: axes, limits, what resists their motion, and which follow others."""

from math import inf, pi
from typing import NoReturn
from xml.etree.ElementTree import Element

from gauss.errors import FileError
from gauss.io.guard import Source
from gauss.io.numbers import bounds, number
from gauss.io.sdf.elements import TRUE, numbers, text, value
from gauss.io.sdf.scopes import MODEL, Scope
from gauss.scene import Scene
from gauss.system.frames import compose

INFINITE = ("inf", "infinity")
KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "ball": "ball", "fixed": "fixed"}
KINDS |= {"universal": "universal", "revolute2": "universal", "screw": "screw"}
SCALAR = ("revolute", "prismatic", "screw")


class JointReader:
    """Joints of one scope while it becomes a part of a scene.

    Parameters
    ----------
    source : Source
        The file.
    scope : Scope
        World or model.
    scene : Scene
        Scene that gets them.
    left : set of str
        Gets the tags of what a warning is to name.
    """

    def __init__(self, source: Source, scope: Scope, scene: Scene, left: set[str]):
        self.source, self.scope, self.result, self.left = source, scope, scene, left

    def add(self, element: Element, parent: str, child: str):
        """Add a joint between two bodies, with its springs, dampers and friction."""
        name, kind = element.get("name", ""), element.get("type", "")
        if kind not in KINDS:
            self._refuse(element, f"joint {name!r}: a joint of type {kind!r} is not modelled.")
        options = self._axes(element, name, kind)
        axis = element.find("axis")
        low, high = self._limits(element, axis) if KINDS[kind] in SCALAR and kind != "continuous" else (-inf, inf)
        limits, called = bounds(low, high) if low < high else None, self.scope.prefix + name
        self.result.joint(called, KINDS[kind], parent, child, **options, **({"limits": limits} if limits else {}))
        if low == high:
            law = "displacement" if kind == "prismatic" else "angle"
            self.result.drive(called, name=f"{called} is locked", **{law: low})
        for given in (axis, element.find("axis2")):
            if given is not None:
                self._dynamics(given.find("dynamics"), name, kind)

    def mimic(self, element: Element):
        """Couple a joint with those that its axis follows."""
        for mimic in element.iterfind("axis/mimic"):
            name, driver = element.get("name"), mimic.get("joint", "")
            self.scope.element(driver, mimic)
            if mimic.get("axis", "axis") != "axis":
                self._refuse(mimic, f"joint {name!r}: only the first axis of a joint is mimicked.")
            ratio = value(self.source, mimic, "multiplier", 1.0)
            offset = value(self.source, mimic, "offset") - ratio * value(self.source, mimic, "reference")
            driven, driver = (f"{self.scope.prefix}{joint}" for joint in (name, driver))
            self.result.couple(f"{driven} mimics {driver}", driven, driver, ratio, offset)

    def _axes(self, element: Element, name: str, kind: str) -> dict:
        """Point, axes and pitch of a joint."""
        R, at = compose(self.scope.pose, self.scope.of(name, element))
        options: dict = {"at": tuple(at)}
        if kind == "fixed" or kind == "ball":
            options |= {"rotation": R}
        else:
            options |= {"axis": self._axis(element, "axis")}
        if KINDS[kind] == "universal":
            options |= {"second_axis": self._axis(element, "axis2")}
        if kind == "screw":
            options |= {"pitch": self._pitch(element, name)}
        return options

    def _pitch(self, element: Element, name: str) -> float:
        """Advance of a screw [m/rad]; <thread_pitch> is the turn for each advance [rad/m] of a left-handed thread."""
        pitch, former = element.find("screw_thread_pitch"), element.find("thread_pitch")
        if pitch is not None:
            return numbers(self.source, pitch, 1)[0] / (2 * pi)
        if former is None:
            self._refuse(element, f"joint {name!r}: give <screw_thread_pitch>, the advance for each turn [m].")
        turned = numbers(self.source, former, 1)[0]
        if not turned:
            self._refuse(former, f"joint {name!r}: <thread_pitch> of 0 rad/m; a screw turns, else use a prismatic joint.")
        return -1.0 / turned

    def _axis(self, element: Element, tag: str) -> tuple:
        """Axis of a joint in the world."""
        axis, name = element.find(tag), element.get("name", "")
        if axis is None:
            self._refuse(element, f"joint {name!r}: <{tag}> is missing.")
        xyz = axis.find("xyz")
        direction = [0.0, 0.0, 1.0] if xyz is None else numbers(self.source, xyz, 3)
        named = name if xyz is None else xyz.get("expressed_in") or name
        if text(axis, "use_parent_model_frame") in TRUE:
            named = MODEL
        return tuple(compose(self.scope.pose, self.scope.of(named, axis))[0] @ direction)

    def _limits(self, element: Element, axis: Element | None) -> tuple[float, float]:
        """Least and largest coordinate; the same twice where a joint is locked."""
        given = None if axis is None else axis.find("limit")
        low, high = self._limit(given, "lower", -inf), self._limit(given, "upper", inf)
        if low > high:
            self._refuse(given, f"joint {element.get('name')!r}: its lower limit is above the upper one; exchange them.")
        return low, high

    def _limit(self, limit: Element | None, tag: str, default: float) -> float:
        found = "" if limit is None else text(limit, tag).lower()
        if found.lstrip("+-") in INFINITE or abs(number(found) or 0.0) == inf:
            return -inf if found[0] == "-" else inf
        return value(self.source, limit, tag, default)

    def _dynamics(self, dynamics: Element | None, name: str, kind: str):
        """Damping, friction and spring along an axis."""
        resisting = {tag: value(self.source, dynamics, tag) for tag in ("damping", "friction", "spring_stiffness")}
        if kind == "fixed" or not any(resisting.values()):
            return
        if kind == "ball":
            self.left.add(kind)
        elif KINDS[kind] not in SCALAR:
            what = ", ".join(tag for tag, found in resisting.items() if found)
            self._refuse(dynamics, f"joint {name!r}: {what} of a {kind} joint is not modelled; remove it.")
        else:
            self._resist(self.scope.prefix + name, dynamics, **resisting)

    def _resist(self, joint: str, dynamics: Element | None, damping: float, friction: float, spring_stiffness: float):
        if damping or spring_stiffness:
            rest = value(self.source, dynamics, "spring_reference")
            self.result.joint_spring(f"spring of {joint}", joint, stiffness=spring_stiffness, damping=damping, rest=rest)
        if friction:
            self.result.joint_friction(joint, friction)

    def _refuse(self, element: Element | None, why: str) -> NoReturn:
        raise FileError(f"{self.source.place(element)}: {why}")
